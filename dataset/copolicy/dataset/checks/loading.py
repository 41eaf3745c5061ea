"""Rules on what LeRobot needs to load each episode: referenced files, tasks, statistics of the frames."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..arrays import Array
from ..exceptions import CopolicyError
from ..features import features_of
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding, Severity


def _files(data: EpisodeData) -> Iterator[Finding]:
    from ..lerobot_folder.loading import file_problems

    for problem in file_problems(data.root, data.info, data.episodes.to_pylist(), data.data_files):
        yield Finding(str(problem.episode), "loading", None, None, "error", problem.message)


def _tasks(data: EpisodeData) -> Iterator[Finding]:
    from ..lerobot_folder.loading import task_problems

    used = np.unique(data.frames["task_index"]).tolist()
    for problem in task_problems(data.root, data.info, data.episodes.to_pylist(), used):
        label = "" if problem.episode is None else str(problem.episode)
        yield Finding(label, "tasks", None, None, "error", problem.message)


def _statistics(data: EpisodeData) -> Iterator[Finding]:
    from ..lerobot_folder.loading import read_frame_statistics, statistics_problems

    problems = list(statistics_problems(data.root, data.info))
    for problem in problems:
        yield Finding("", "frame_statistics", None, None, "error", problem.message)
    if problems or len(data.framed) < len(data.labels):
        return
    try:
        stored = read_frame_statistics(data.root)
    except CopolicyError:
        return
    # LeRobot's merge does not update the statistics of the running numbers (index, episode_index).
    features = features_of(data.task.spec)
    for name, values in ((name, values) for name, values in data.frames.items() if name in features):
        rows = values.reshape(data.frame_count, -1).astype(float)
        if name in stored and np.isfinite(rows).all():  # else a finding of `finite`
            yield from _compare(data, name, stored[name], rows)


def _compare(data: EpisodeData, name: str, stored: Mapping[str, Any], rows: Array) -> Iterator[Finding]:
    from ..lerobot_folder.loading import STATISTICS, number_array

    warning, error = (data.limit(f"frame_statistics.{grade}") for grade in ("warning", "error"))
    computed = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    scale = 1 + np.abs(rows).max(axis=0)
    errors = {key: float((np.abs(number_array(stored[key], None) - computed[key]) / scale).max()) for key in STATISTICS}
    statistic = max(errors, key=lambda key: errors[key])
    if not errors[statistic] <= warning:
        severity: Severity = "error" if not errors[statistic] <= error else "warning"
        bound = error if severity == "error" else warning
        message = f"the {statistic} of {name} in meta/stats.json differs from the frames by this much of their range"
        yield Finding("", "frame_statistics", errors[statistic], bound, severity, message)
    count = int(np.asarray(stored["count"]).reshape(-1)[0])
    if count != len(rows):
        message = f"the count of {name} in meta/stats.json differs from the number of frames"
        yield Finding("", "frame_statistics", count, len(rows), "warning", message)


RULES = (
    Rule("loading", "every episode's files are where the metadata say", _files, kinds=("lerobot",), whole=True),
    Rule("tasks", "the sentences of the tasks are there", _tasks, ("task_index",), kinds=("lerobot",), whole=True),
    Rule("frame_statistics", "meta/stats.json describes the frames", _statistics, kinds=("lerobot",), whole=True),
)
