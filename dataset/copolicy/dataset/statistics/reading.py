"""Reads the episodes of a LeRobot v3 data set for its statistics: three columns of the frames, no images."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import CopolicyError, FileFormatError, MissingExtraError, RunError
from ..features import ACTION, ENVIRONMENT_STATE, STATE, map_of
from ..files import visible_files
from .trajectories import EpisodeRow, Trajectories

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

_EPISODE_COLUMNS = (
    "episode_index", "length", "episode_uuid", "pair_id", "map_id", "source", "success", "duration_s", "route_class",
    "discarded",
)  # fmt: skip
_OBSTACLE_SIZE = 50  # px; of a map in no set, in a data set of an earlier version, which does not tell


def read_trajectories(root: Path, source: str | None = None) -> tuple[Trajectories, dict[str, int]]:
    """The episodes of a data set that count, and how many were left out for each reason.

    Discarded episodes do not count: those that their operator discarded, those of `copolicy-dataset exclude`.

    Args:
        source: only episodes of this source (`human`, `simulated` or `upstream`).

    Raises:
        FileFormatError: no LeRobot v3 data set of this task, or a damaged one.
        RunError: no episode is left.
    """
    info = _info(root)
    rows = _episodes(root)
    states, actions, maps = _frames(root, [row["length"] for row in rows])
    split_of = _splits(info.get("splits") or {}, len(rows))
    left_out = {"discarded": 0, "other_source": 0, "empty": 0}
    kept: list[tuple[np.ndarray, np.ndarray]] = []
    kept_rows: list[EpisodeRow] = []
    begin = 0
    for index, row in enumerate(rows):
        frames = slice(begin, begin + row["length"])
        begin += row["length"]
        reason = (
            "discarded" if row["discarded"]
            else "other_source" if source is not None and row["source"] != source
            else "empty" if row["length"] < 2
            else None
        )  # fmt: skip
        if reason:
            left_out[reason] += 1
            continue
        kept.append((states[frames], actions[frames]))
        kept_rows.append(_row(root, row, maps[index], split_of[index]))
    if not kept:
        raise RunError(f"{root}: expected an episode to describe, found {len(rows)}, left out {left_out}")
    return Trajectories.of(kept, kept_rows, int(info["fps"])), {name: n for name, n in left_out.items() if n}


def _info(root: Path) -> Mapping[str, Any]:
    path = root / "meta" / "info.json"
    if not path.is_file():
        raise FileFormatError(root, "a LeRobot v3 data set with meta/info.json", "none")
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
        version, fps = str(info["codebase_version"]), info["fps"]
    except (ValueError, KeyError, TypeError) as error:
        raise FileFormatError(path, "LeRobot's info as JSON", f"{type(error).__name__} {error}") from None
    if not version.startswith("v3") or not isinstance(fps, int) or fps < 1:
        raise FileFormatError(path, "codebase_version v3.x and fps", f"{version} and {fps!r}")
    return info


def _episodes(root: Path) -> list[dict[str, Any]]:
    files = _files(root, "meta/episodes")
    rows = [row for path in files for row in _table(path, _EPISODE_COLUMNS, ("obstacle_size",)).to_pylist()]
    rows.sort(key=lambda row: row["episode_index"])
    if [row["episode_index"] for row in rows] != list(range(len(rows))):
        raise FileFormatError(root / "meta/episodes", "episodes 0 to n - 1, each once", f"{len(rows)} others")
    return rows


def _frames(root: Path, lengths: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States and actions of all frames, and the environment state of each episode."""
    parts: dict[str, list[np.ndarray]] = {STATE: [], ACTION: [], ENVIRONMENT_STATE: []}
    order: list[np.ndarray] = []
    for path in _files(root, "data"):
        table = _table(path, (*parts, "index"))
        order.append(table["index"].to_numpy())
        for name, width in ((STATE, 7), (ACTION, 4), (ENVIRONMENT_STATE, 11)):
            flat = table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
            if len(flat) != width * len(table):
                raise FileFormatError(path, f"{name} of {width} numbers", f"{len(flat)} in {len(table)} rows")
            parts[name].append(flat.reshape(-1, width))
    places = np.concatenate(order)
    if len(places) != sum(lengths) or not np.array_equal(np.sort(places), np.arange(len(places))):
        raise FileFormatError(root / "data", f"{sum(lengths)} frames, each once", f"{len(places)}")
    by_index = np.argsort(places)
    states, actions, environment = (np.concatenate(parts[name])[by_index] for name in parts)
    for name, values in ((STATE, states), (ACTION, actions)):
        if not np.isfinite(values).all():
            raise FileFormatError(root / "data", f"finite {name}", "nan or inf")
    firsts = np.minimum(np.cumsum([0, *lengths[:-1]]), len(environment) - 1)
    return states, actions, environment[firsts]


def _row(root: Path, row: dict[str, Any], environment: np.ndarray, split: str) -> EpisodeRow:
    guessed = 45 if row["map_id"].startswith(("holdout", "unseen")) else _OBSTACLE_SIZE
    size = row.get("obstacle_size") or guessed
    try:
        config = map_of(environment, size)
    except CopolicyError as error:
        raise FileFormatError(root, f"a map in episode {row['episode_index']}", str(error)) from None
    names = ("episode_uuid", "pair_id", "map_id", "source", "success", "duration_s", "route_class")
    return EpisodeRow(**{name: row[name] for name in names}, map_config=config, split=split)


def _splits(splits: Mapping[str, str], episodes: int) -> list[str]:
    """Name of the split of each episode, from `{"train": "0:80", "test": "80:100"}`; empty where none has it."""
    names = [""] * episodes
    for name, span in splits.items():
        first, _, last = str(span).partition(":")
        if first.isdecimal() and last.isdecimal():
            names[int(first) : min(int(last), episodes)] = [name] * max(0, min(int(last), episodes) - int(first))
    return names


def _files(root: Path, folder: str) -> list[Path]:
    files = visible_files(root / folder, "*.parquet")
    if not files:
        raise FileFormatError(root, f"parquet files under {folder}", "none")
    return files


def _table(path: Path, columns: tuple[str, ...], optional: tuple[str, ...] = ()) -> "pa.Table":
    try:
        stored = pq.read_schema(path).names
        missing = [name for name in columns if name not in stored]
        if missing:
            raise FileFormatError(path, "the columns of copolicy", f"none named {', '.join(missing)}")
        wanted = [*columns, *(name for name in optional if name in stored)]
        return pq.read_table(path, columns=wanted, use_threads=False)
    except (pa.ArrowInvalid, OSError) as error:
        raise FileFormatError(path, "a complete parquet file", str(error).splitlines()[0]) from None
