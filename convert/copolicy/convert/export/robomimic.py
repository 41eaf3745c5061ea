"""Exports to the HDF5 layout of robomimic, one file.

`data/demo_i` with `actions`, `obs/*` and `next_obs/*` (named as in the environment), `rewards`, `dones` and `states`;
its attributes are the episode columns, `source` among them. Filter keys under `mask`: each split of the data set (`val`
and `validation` as robomimic's `valid`), or `train` and `valid` as asked for, `success` and `failure`, and one for each
source.
Format: https://robomimic.github.io/docs/datasets/overview.html
"""

import hashlib
import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from copolicy.dataset.edit.groups import By, group_episodes
from copolicy.dataset.edit.parts import Part, assign_groups
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import OBSERVATION_KEYS
from copolicy.dataset.files.staging import new_file

from .hdf5_file import new_hdf5
from .source import ExportEpisode, ExportSource

_GYM = 2  # robomimic's EnvType.GYM_TYPE
_SPLITS = {"val": "valid", "validation": "valid"}


@dataclass(frozen=True)
class Validation:
    """Episodes to set apart as `valid`.

    Attributes:
        proportion: of the exported episodes, in (0, 1).
        by: what is never in both `train` and `valid` (`copolicy.dataset.edit.parts`).
        seed: of the choice.
    """

    proportion: float
    by: By = "pairs"
    seed: int = 0

    def __post_init__(self):
        if not 0 < self.proportion < 1:
            raise InvalidValueError("--valid", "a proportion between 0 and 1", self.proportion)


def export_robomimic(source: ExportSource, out: Path, validation: Validation | None = None) -> dict[str, Any]:
    """Writes the file at `out`; returns facts for the summary.

    Args:
        validation: what the filter keys `train` and `valid` hold, where the data set names no splits itself.

    Raises:
        OutputExistsError: there is something at `out`.
        InvalidValueError: the data set names several splits, and others are asked for.
        RunError: nothing can be set apart without being in both.
    """
    if validation is not None and len(source.splits) > 1:
        found = f"the splits {', '.join(source.splits)} in {source.root}"
        raise InvalidValueError("--valid", "a data set without a split of its own", found)
    motions: list[str] = []
    with new_file(out) as partial, new_hdf5(partial) as (file, storage):
        data = file.create_group("data")
        masks: dict[str, list[str]] = defaultdict(list)
        for number, episode in enumerate(source.episodes()):
            name = f"demo_{number}"
            _write_demo(data.create_group(name), episode)
            motions.append(hashlib.sha256(episode.states.tobytes() + episode.actions.tobytes()).hexdigest())
            storage.check()
            for mask in _masks(source, episode, splits=validation is None):
                masks[mask].append(name)
        if validation is not None:
            masks |= _set_apart(source, motions, validation)
        gym_id, kwargs = source.environment
        environment = {"env_name": gym_id, "type": _GYM, "env_kwargs": kwargs}
        data.attrs.update({"total": source.frames, "env_args": json.dumps(environment)})
        data.attrs["copolicy"] = json.dumps(source.facts())
        for mask, names in masks.items():
            file[f"mask/{mask}"] = np.array(names, dtype="S")
    return {"frames": source.frames, "filter_keys": {mask: len(names) for mask, names in sorted(masks.items())}}


def _write_demo(group: h5py.Group, episode: ExportEpisode) -> None:
    count = len(episode)
    environment = np.tile(episode.environment, (count, 1))
    before = episode.states, environment, episode.human_actions
    after = episode.next_states(), environment, episode.actions[:, episode.human_actions.shape[1] :]
    arrays = {
        "actions": episode.actions,
        "rewards": episode.rewards,
        "dones": (np.arange(count) == count - 1).astype(np.int64),
        # Enough to set the environment to: the state and the vector of the scenario.
        "states": np.hstack((episode.states, environment)),
        **{f"obs/{key}": values for key, values in zip(OBSERVATION_KEYS, before, strict=True)},
        **{f"next_obs/{key}": values for key, values in zip(OBSERVATION_KEYS, after, strict=True)},
    }
    for name, values in arrays.items():
        group.create_dataset(name, data=values)
    group.attrs.update({"num_samples": count, "episode_index": episode.index, **episode.meta})


def _masks(source: ExportSource, episode: ExportEpisode, splits: bool) -> list[str]:
    inside = [name for name, indices in source.splits.items() if splits and episode.index in indices]
    names = [_SPLITS.get(name, name) for name in inside]
    return [*names, "success" if episode.meta["success"] else "failure", f"source_{episode.meta['source']}"]


def _set_apart(source: ExportSource, motions: list[str], validation: Validation) -> dict[str, list[str]]:
    parts = [Part("train", 1 - validation.proportion), Part("valid", validation.proportion)]
    together = group_episodes(source.rows, motions, validation.by)
    dealt = assign_groups(source.rows, together, parts, validation.by, validation.seed, "--valid")
    return {name: [f"demo_{place}" for place in places] for name, places in dealt.items()}
