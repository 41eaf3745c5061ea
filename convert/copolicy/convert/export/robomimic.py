"""Exports to the HDF5 layout of robomimic, one file.

`data/demo_i` with `actions`, `obs/*`, `next_obs/*`, `rewards`, `dones` and `states`; its attributes are the episode
columns, `source` among them. Filter keys under `mask`: each split of the data set (`val` and `validation` as
robomimic's `valid`), `success` and `failure`, and one for each source.
Format: https://robomimic.github.io/docs/datasets/overview.html
"""

import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import MissingExtraError
from copolicy.dataset.staging import new_file

from .hdf5_file import new_hdf5
from .source import ExportEpisode, ExportSource

try:
    import h5py
except ModuleNotFoundError:
    raise MissingExtraError("h5py") from None

_GYM = 2  # robomimic's EnvType.GYM_TYPE
_ENVIRONMENT = "copolicy/TableCarrying-v0"  # registered by importing lerobot_policy_copolicy
_SPLITS = {"val": "valid", "validation": "valid"}


def export_robomimic(source: ExportSource, out: Path) -> dict[str, Any]:
    """Writes the file at `out`; returns facts for the summary.

    Raises:
        OutputExistsError: there is something at `out`.
    """
    with new_file(out) as partial, new_hdf5(partial) as (file, storage):
        data = file.create_group("data")
        masks: dict[str, list[str]] = defaultdict(list)
        for number, episode in enumerate(source.episodes()):
            name = f"demo_{number}"
            _write_demo(data.create_group(name), episode)
            storage.check()
            for mask in _masks(source, episode):
                masks[mask].append(name)
        environment = {"env_name": _ENVIRONMENT, "type": _GYM, "env_kwargs": {"fps": source.fps}}
        data.attrs.update({"total": source.frames, "env_args": json.dumps(environment)})
        data.attrs["copolicy"] = json.dumps(source.facts())
        for mask, names in masks.items():
            file[f"mask/{mask}"] = np.array(names, dtype="S")
    return {"frames": source.frames, "filter_keys": {mask: len(names) for mask, names in sorted(masks.items())}}


def _write_demo(group: h5py.Group, episode: ExportEpisode) -> None:
    count = len(episode)
    environment = np.tile(episode.environment, (count, 1))
    after = episode.next_states()
    arrays = {
        "actions": episode.actions,
        "rewards": episode.rewards,
        "dones": (np.arange(count) == count - 1).astype(np.int64),
        # Enough to set the environment to: the table's state and the map.
        "states": np.hstack((episode.states, environment)),
        "obs/state": episode.states,
        "obs/environment_state": environment,
        "obs/human_action": episode.human_actions,
        "next_obs/state": after,
        "next_obs/environment_state": environment,
        "next_obs/human_action": episode.actions[:, 2:],
    }
    for name, values in arrays.items():
        group.create_dataset(name, data=values)
    group.attrs.update({"num_samples": count, "episode_index": episode.index, **episode.meta})


def _masks(source: ExportSource, episode: ExportEpisode) -> list[str]:
    splits = [_SPLITS.get(name, name) for name, indices in source.splits.items() if episode.index in indices]
    return [*splits, "success" if episode.meta["success"] else "failure", f"source_{episode.meta['source']}"]
