"""Exports to a Zarr v2 store that diffusion_policy's ReplayBuffer reads, with the arrays of the original program.

`data/obs`, `data/action`, `data/past_action`, `meta/episode_ends (E,)`; obs is the state followed by the scenario
vector: `(N, 18)` for the table, actions `(N, 4)`. The alignment defines a row:

    ours      obs[i] is the state in which action[i] was taken, past_action[i] the action of the previous row. A policy
              trained on it with the original program acts on its current observation; use this for training.
    upstream  obs[i] is the state one step of 1/30 s after action[i] began, past_action[i] the action of the step
              before it, as in the released store: for mixing with that store, or for reproducing published results,
              which pair each observation with the action that produced it.

For `upstream`, a data set at 30 Hz gives exact rows (every third step is kept, since the store has 10 Hz). From 10 Hz,
the state one step later is integrated under the episode's physics (the default if unknown), and past_action is the
action of the previous frame.
"""

import json
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import previous_actions
from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError
from copolicy.dataset.files.staging import new_folder
from copolicy.dataset.task import TABLE
from copolicy.dataset.task_spec import RECORD_HZ

from ..upstream.zarr_episodes import ZARR_HZ, advance_one_step
from .source import ExportEpisode, ExportSource

Alignment = Literal["ours", "upstream"]
"""Which state a row pairs with its action."""

_COMPRESSOR = {"id": "blosc", "cname": "lz4", "clevel": 5, "shuffle": 0, "blocksize": 0}
_CHUNK_ROWS = 16384


def export_replay_buffer(source: ExportSource, out: Path, alignment: Alignment = "ours") -> dict[str, Any]:
    """Writes the store at `out`; returns facts for the summary.

    Raises:
        InvalidValueError: `upstream` for another task than the table, or for a data set not at 10 or 30 Hz.
        MissingExtraError: numcodecs is not installed.
        OutputExistsError: `out` exists.
    """
    spec = source.task.spec
    if alignment == "upstream" and spec.name != TABLE:
        expected = f"ours: upstream is the layout of the original program, whose task is {TABLE!r}"
        raise InvalidValueError("--alignment", expected, f"upstream for the task {spec.name!r}")
    if alignment == "upstream" and source.fps not in (ZARR_HZ, RECORD_HZ):
        raise InvalidValueError("--alignment", f"a data set at {ZARR_HZ} or {RECORD_HZ} Hz for upstream", source.fps)
    with new_folder(out) as partial:
        rows = [_rows(episode, alignment) for episode in source.episodes()]
        ends = np.cumsum([len(actions) for _, actions, _ in rows])
        _write_group(partial)
        for group in ("data", "meta"):
            _write_group(partial / group)
        for name, arrays in zip(("obs", "action", "past_action"), zip(*rows, strict=True), strict=True):
            _write_array(partial / "data" / name, np.concatenate(arrays).astype("<f8"))
        _write_array(partial / "meta" / "episode_ends", ends.astype("<i8"))
        fps = ZARR_HZ if alignment == "upstream" else source.fps
        attributes = {
            **source.facts(),
            "fps": fps,
            "alignment": alignment,
            "obs": [*spec.state.names, *spec.scenario.names],
            "action": list(spec.joint_action.names),
            "past_action": "action of the row before" if not _exact(source.fps, alignment) else "of the step before",
            "episodes": [
                {key: _jsonable(value) for key, value in row.items() if key != "length"} for row in source.rows
            ],
        }
        (partial / ".zattrs").write_text(json.dumps(attributes, indent=1, allow_nan=False), encoding="utf-8")
    return {"alignment": alignment, "fps": fps, "rows": int(ends[-1])}


def _exact(fps: int, alignment: Alignment) -> bool:
    return alignment == "upstream" and fps == RECORD_HZ


def _rows(episode: ExportEpisode, alignment: Alignment) -> tuple[Array, Array, Array]:
    """obs `(T, n)`, action and past_action `(T, m)`."""
    states, actions = episode.states.astype(float), episode.actions.astype(float)
    past = previous_actions(actions)
    if _exact(episode.fps, alignment):
        sampled = slice(None, None, RECORD_HZ // ZARR_HZ)
        states, actions, past = episode.next_states().astype(float)[sampled], actions[sampled], past[sampled]
    elif alignment == "upstream":
        states = advance_one_step(states, actions, episode.settings)
    environment = np.tile(episode.environment.astype(float), (len(states), 1))
    return np.hstack((states, environment)), actions, past


def _jsonable(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _write_group(folder: Path) -> None:
    folder.mkdir()
    (folder / ".zgroup").write_text(json.dumps({"zarr_format": 2}), encoding="utf-8")


def _write_array(folder: Path, array: Array) -> None:
    try:
        from numcodecs.blosc import Blosc
    except ImportError:
        raise MissingExtraError("numcodecs") from None
    codec = Blosc(**{key: value for key, value in _COMPRESSOR.items() if key != "id"})
    length = min(len(array), _CHUNK_ROWS)
    folder.mkdir()
    metadata = {
        "zarr_format": 2,
        "shape": list(array.shape),
        "chunks": [length, *array.shape[1:]],
        "dtype": array.dtype.str,
        "compressor": _COMPRESSOR,
        "fill_value": 0,
        "order": "C",
        "filters": None,
    }
    (folder / ".zarray").write_text(json.dumps(metadata, indent=1), encoding="utf-8")
    for number, start in enumerate(range(0, len(array), length)):
        # Every chunk has the full length; readers ignore rows beyond the end of the array.
        chunk = np.zeros((length, *array.shape[1:]), array.dtype)
        chunk[: len(array) - start] = array[start : start + length]
        name = ".".join([str(number), *"0" * (array.ndim - 1)])
        (folder / name).write_bytes(codec.encode(chunk))
