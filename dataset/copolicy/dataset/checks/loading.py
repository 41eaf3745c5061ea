"""Whether LeRobot can load any single episode: files that the metadata name, tasks, statistics of the frames."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..exceptions import CopolicyError
from ..features import features_of
from ..task_parts import Rule
from .episode_table import EpisodeTable
from .finding import Finding, Severity


def _files(table: EpisodeTable) -> Iterator[Finding]:
    from ..lerobot_folder.loading import file_problems

    for problem in file_problems(table.root, table.info, table.episodes.to_pylist(), table.data_files):
        yield Finding(str(problem.episode), "loading", None, None, "error", problem.message)


def _tasks(table: EpisodeTable) -> Iterator[Finding]:
    from ..lerobot_folder.loading import task_problems

    used = np.unique(table.frames["task_index"]).tolist()
    for problem in task_problems(table.root, table.info, table.episodes.to_pylist(), used):
        label = "" if problem.episode is None else str(problem.episode)
        yield Finding(label, "tasks", None, None, "error", problem.message)


def _statistics(table: EpisodeTable) -> Iterator[Finding]:
    from ..lerobot_folder.loading import read_frame_statistics, statistics_problems

    problems = list(statistics_problems(table.root, table.info))
    for problem in problems:
        yield Finding("", "frame_statistics", None, None, "error", problem.message)
    if problems or len(table.framed) < len(table.labels):
        return
    try:
        stored = read_frame_statistics(table.root)
    except CopolicyError:
        return
    # LeRobot's merge leaves those of the running numbers (index, episode_index) as they were in the parts.
    ours = features_of(table.task.spec)
    for name, values in ((name, values) for name, values in table.frames.items() if name in ours):
        rows = values.reshape(table.frame_count, -1).astype(float)
        if name in stored and np.isfinite(rows).all():  # else said by `finite`
            yield from _against_frames(table, name, stored[name], rows)


def _against_frames(table: EpisodeTable, name: str, stored: Mapping[str, Any], rows: np.ndarray) -> Iterator[Finding]:
    from ..lerobot_folder.loading import STATISTICS, number_array

    warning, error = (table.limit(f"frame_statistics.{grade}") for grade in ("warning", "error"))
    figures = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    scale = 1 + np.abs(rows).max(axis=0)
    off = {kind: float((np.abs(number_array(stored[kind], None) - figures[kind]) / scale).max()) for kind in STATISTICS}
    kind = max(off, key=lambda kind: off[kind])
    if not off[kind] <= warning:
        severity: Severity = "error" if not off[kind] <= error else "warning"
        bound = error if severity == "error" else warning
        message = f"the {kind} of {name} in meta/stats.json is not that of the frames, relative to their range"
        yield Finding("", "frame_statistics", off[kind], bound, severity, message)
    count = int(np.asarray(stored["count"]).reshape(-1)[0])
    if count != len(rows):
        message = f"the count of {name} in meta/stats.json is not that of the frames"
        yield Finding("", "frame_statistics", count, len(rows), "warning", message)


RULES = (
    Rule("loading", "every episode's files are where the metadata say", _files, kinds=("lerobot",), whole=True),
    Rule("tasks", "the sentences of the tasks are there", _tasks, ("task_index",), kinds=("lerobot",), whole=True),
    Rule("frame_statistics", "meta/stats.json describes the frames", _statistics, kinds=("lerobot",), whole=True),
)
