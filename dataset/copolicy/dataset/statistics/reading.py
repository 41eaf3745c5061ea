"""Reads the episodes of a LeRobot v3 data set for statistics: states, actions and scenarios, no images."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..arrays import Array
from ..exceptions import CopolicyError, FileFormatError, RunError
from ..features import ACTION, ENVIRONMENT_STATE, STATE, features_of
from ..lerobot_folder.folder import LeRobotFolder
from ..lerobot_folder.info import split_range
from ..lerobot_folder.tables import row_count
from .trajectories import EpisodeRow, Trajectories

_EPISODE_COLUMNS = (
    "episode_uuid", "pair_id", "map_id", "source", "success", "duration_s", "route_class",
    "discarded", "obstacle_size", "obstacle_sizes",
)  # fmt: skip


def read_trajectories(root: Path, source: str | None = None) -> tuple[Trajectories, dict[str, int]]:
    """Reads the episodes of a data set, and the number of omitted episodes by reason.

    Discarded episodes are omitted: those discarded by the operator or by `copolicy-dataset exclude`.

    Args:
        source: only episodes of this source (`human`, `simulated` or `upstream`).

    Raises:
        FileFormatError: not a LeRobot v3 data set of an installed task, or a damaged one.
        RunError: all episodes are omitted.
    """
    folder = LeRobotFolder.open(root)
    folder.require_task((STATE, ACTION, ENVIRONMENT_STATE))
    info = folder.info
    rows = folder.rows(_EPISODE_COLUMNS)
    split_of = _splits(info.get("splits") or {}, len(rows))
    left_out = {"discarded": 0, "other_source": 0, "empty": 0}
    motions: list[tuple[Array, Array]] = []
    episode_rows: list[EpisodeRow] = []
    for index, frames in _frames(folder):
        row = rows[index]
        reason = (
            "discarded" if row["discarded"]
            else "other_source" if source is not None and row["source"] != source
            else "empty" if row["length"] < 2
            else None
        )  # fmt: skip
        if reason:
            left_out[reason] += 1
            continue
        motions.append((frames[STATE], frames[ACTION]))
        episode_rows.append(_row(folder, row, frames[ENVIRONMENT_STATE][0], split_of[index]))
    if not motions:
        raise RunError(f"{root}: expected an episode to describe, found {len(rows)}, left out {left_out}")
    return Trajectories.from_episodes(motions, episode_rows, int(info["fps"]), folder.task), {
        name: n for name, n in left_out.items() if n
    }


def _frames(folder: LeRobotFolder) -> Iterator[tuple[int, dict[str, Array]]]:
    total, actual = sum(folder.lengths), sum(row_count(path) for path in folder.data_files)
    if actual != total:
        raise FileFormatError(folder.root / "data", f"{total} frames with index 0, 1, ..., each once", f"{actual}")
    features = features_of(folder.task.spec)
    return folder.frames({name: features[name]["shape"] for name in (STATE, ACTION, ENVIRONMENT_STATE)})


def _row(folder: LeRobotFolder, row: dict[str, Any], vector: Array, split: str) -> EpisodeRow:
    try:
        scenario = folder.task.scenario_of_vector(vector, row)
    except CopolicyError as error:
        raise FileFormatError(folder.root, f"a map in episode {row['episode_index']}", str(error)) from None
    names = ("episode_uuid", "pair_id", "map_id", "source", "success", "duration_s", "route_class")
    return EpisodeRow(**{name: row[name] for name in names}, scenario=scenario, split=split)


def _splits(splits: Mapping[str, str], episodes: int) -> list[str]:
    """Split of each episode, from `{"train": "0:80", "test": "80:100"}`; empty for episodes outside of all splits."""
    names = [""] * episodes
    for name, span in splits.items():
        numbers = split_range(span) or range(0)
        for episode in range(numbers.start, min(numbers.stop, episodes)):
            names[episode] = name
    return names
