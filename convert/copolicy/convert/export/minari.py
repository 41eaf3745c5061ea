"""Exports to a Minari data set: a folder NAME-vN with `data/metadata.json` and `data/main_data.hdf5`.

Read it with `minari.load_dataset("NAME-vN")`, with MINARI_DATASETS_PATH set to its parent folder, or with
`minari.MinariDataset(".../NAME-vN/data")`. An episode has T actions and T + 1 observations, with the environment's
names; its metadata are the episode columns. `recover_environment()` needs `lerobot_policy_copolicy[train]` and makes
the environment with the rate and physics of the data. Format: https://minari.farama.org/content/dataset_standards/
"""

import json
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import frames
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import ACTION, GYM_ID, OBSERVATION_KEYS, PAIR_GYM_ID, bounds_of
from copolicy.dataset.files.staging import new_folder
from copolicy.dataset.task import distribution_of
from copolicy.dataset.task_spec import TIMEOUT

from .hdf5_file import new_hdf5
from .source import ExportEpisode, ExportSource

_FORMAT_VERSION = "0.5.0"
"""Version of Minari that defined this layout; later versions read it, earlier ones reject it."""

_PACKAGE = "lerobot_policy_copolicy"
_ENTRY_POINTS = {
    GYM_ID: f"{_PACKAGE}.env.table_carrying:TableCarryingEnv",
    PAIR_GYM_ID: f"{_PACKAGE}.env.pair_env:PairEnv",
}


def export_minari(source: ExportSource, out: Path) -> dict[str, Any]:
    """Writes the folder at `out`; returns facts for the summary.

    Raises:
        InvalidValueError: the name of `out` is no id of a Minari data set.
        OutputExistsError: `out` exists.
    """
    if not re.fullmatch(r"[\w-]+-v\d+", out.name):
        raise InvalidValueError("--out", "a folder named as Minari names data sets, NAME-vN", out.name)
    spec, package, facts = source.task.spec, distribution_of(source.task), source.facts()
    with new_folder(out) as partial:
        folder = partial / "data"
        folder.mkdir(parents=True)
        path = folder / "main_data.hdf5"
        with new_hdf5(path, track_order=True) as (file, storage):
            bounds = {feature: limits.astype(np.float32) for feature, limits in bounds_of(spec).items()}
            for number, episode in enumerate(source.episodes()):
                group = file.create_group(f"episode_{number}")
                _write_episode(group, number, episode)
                _widen(bounds, group)
                storage.check()
        subspaces = {name: _box(bounds[feature]) for name, feature in OBSERVATION_KEYS.items()}
        metadata = {
            "total_episodes": len(source.rows),
            "total_steps": source.frames,
            "data_format": "hdf5",
            # Minari stores spaces as JSON strings inside the JSON file.
            "observation_space": json.dumps({"type": "Dict", "subspaces": subspaces}),
            "action_space": json.dumps(_box(bounds[ACTION])),
            "env_spec": json.dumps(_environment(source)),
            "requirements": [f"{_PACKAGE}[train]", *([package] if package not in (None, _PACKAGE) else [])],
            "dataset_id": out.name,
            "minari_version": _FORMAT_VERSION,
            "dataset_size": round(path.stat().st_size / 1e6, 1),
            "description": f"{spec.sentence} {source.task.words.cast}; sources: {', '.join(facts['sources'])}.",
            "copolicy": facts,
        }
        (folder / "metadata.json").write_text(json.dumps(metadata, indent=1), encoding="utf-8")
    return {"frames": source.frames, "dataset_id": out.name}


def _environment(source: ExportSource) -> dict[str, Any]:
    """The fields of gymnasium's `EnvSpec`."""
    gym_id, arguments = source.environment
    kwargs = {"step_limit": source.task.settings_type().step_limit, **arguments}
    return {
        "id": gym_id,
        "entry_point": _ENTRY_POINTS.get(gym_id),  # None: gymnasium makes the environment of another task by its id
        "reward_threshold": None,
        "nondeterministic": False,
        "max_episode_steps": frames(kwargs["step_limit"], source.fps, source.task.spec.record_hz),
        "order_enforce": True,
        "disable_env_checker": False,
        "kwargs": kwargs,
        "additional_wrappers": [],
        "vector_entry_point": None,
    }


def _widen(bounds: dict[str, Array], group: h5py.Group) -> None:
    # The task's bounds scale values for training and can be exceeded slightly; a space must contain all values.
    paths = {feature: f"observations/{name}" for name, feature in OBSERVATION_KEYS.items()} | {ACTION: "actions"}
    for feature, path in paths.items():
        values = np.asarray(group[path])
        low, high = bounds[feature]
        bounds[feature] = np.stack((np.minimum(low, values.min(axis=0)), np.maximum(high, values.max(axis=0))))


def _box(bounds: Array) -> dict[str, Any]:
    low, high = bounds
    return {
        "type": "Box", "dtype": "float32", "shape": list(low.shape), "low": low.tolist(), "high": high.tolist(),
    }  # fmt: skip


def _write_episode(group: h5py.Group, number: int, episode: ExportEpisode) -> None:
    last = np.arange(len(episode)) == len(episode) - 1
    # A time-out, or an end that is no termination reason of the task, is a truncation.
    reason = episode.meta["termination_reason"]
    terminated = reason != TIMEOUT and reason in episode.task.spec.reasons
    observations = (
        np.vstack((episode.states, episode.final_state())),
        np.tile(episode.environment, (len(episode) + 1, 1)),
        np.vstack((episode.human_actions, episode.actions[-1:, episode.human_actions.shape[1] :])),
    )
    arrays = {
        **{f"observations/{key}": values for key, values in zip(OBSERVATION_KEYS, observations, strict=True)},
        "actions": episode.actions,
        "rewards": episode.rewards,
        "terminations": last & terminated,
        "truncations": last & (not terminated),
        "infos/success": np.append(np.zeros(len(episode), bool), episode.meta["success"]),
    }
    for name, values in arrays.items():
        group.create_dataset(name, data=values, chunks=True, maxshape=(None, *values.shape[1:]))
    # Minari reads the attribute `seed`; an unknown seed (-1) is left out.
    columns = {name: value for name, value in episode.meta.items() if name != "seed" or value >= 0}
    group.attrs.update({"id": number, "total_steps": len(episode), "episode_index": episode.index, **columns})
