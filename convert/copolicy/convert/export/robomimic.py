"""Exports to one file in robomimic's HDF5 layout.

`data/demo_i` with `actions`, `obs/*` and `next_obs/*` (named as in the environment), `rewards`, `dones` and `states`;
its attributes are the episode columns. Filter keys under `mask`: each split of the data set (`val` and `validation`
as `valid`), or `train` and `valid` of a `Validation`, then `success`, `failure` and one per source.
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
    """Selection of the episodes in the filter key `valid`.

    Attributes:
        proportion: of the exported episodes, in (0, 1).
        by: unit that is never divided between `train` and `valid` (`copolicy.dataset.edit.parts`).
        seed: seed of the random selection.
    """

    proportion: float
    by: By = "pairs"
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.proportion < 1:
            raise InvalidValueError("--valid", "a proportion between 0 and 1", self.proportion)


def export_robomimic(source: ExportSource, out: Path, validation: Validation | None = None) -> dict[str, Any]:
    """Writes the file at `out`; returns facts for the summary.

    Args:
        validation: defines the filter keys `train` and `valid`, for a data set without splits.

    Raises:
        OutputExistsError: `out` exists.
        InvalidValueError: `validation` is given and the data set has several splits.
        RunError: the episodes cannot be divided by `validation.by`.
    """
    if validation is not None and len(source.splits) > 1:
        splits = f"the splits {', '.join(source.splits)} in {source.root}"
        raise InvalidValueError("--valid", "a data set without splits", splits)
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
            masks |= _train_and_valid(source, motions, validation)
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
    observations = episode.states, environment, episode.human_actions
    next_observations = episode.next_states(), environment, episode.actions[:, episode.human_actions.shape[1] :]
    arrays = {
        "actions": episode.actions,
        "rewards": episode.rewards,
        "dones": (np.arange(count) == count - 1).astype(np.int64),
        # What the environment needs to restore a state: the state and the scenario vector.
        "states": np.hstack((episode.states, environment)),
        **{f"obs/{key}": values for key, values in zip(OBSERVATION_KEYS, observations, strict=True)},
        **{f"next_obs/{key}": values for key, values in zip(OBSERVATION_KEYS, next_observations, strict=True)},
    }
    for name, values in arrays.items():
        group.create_dataset(name, data=values)
    group.attrs.update({"num_samples": count, "episode_index": episode.index, **episode.meta})


def _masks(source: ExportSource, episode: ExportEpisode, splits: bool) -> list[str]:
    splits_of_episode = [name for name, indices in source.splits.items() if splits and episode.index in indices]
    names = [_SPLITS.get(name, name) for name in splits_of_episode]
    return [*names, "success" if episode.meta["success"] else "failure", f"source_{episode.meta['source']}"]


def _train_and_valid(source: ExportSource, motions: list[str], validation: Validation) -> dict[str, list[str]]:
    parts = [Part("train", 1 - validation.proportion), Part("valid", validation.proportion)]
    units = group_episodes(source.rows, motions, validation.by)
    indices = assign_groups(source.rows, units, parts, validation.by, validation.seed, "--valid")
    return {name: [f"demo_{index}" for index in selected] for name, selected in indices.items()}
