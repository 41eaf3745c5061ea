"""Whether LeRobot can load any single episode: files that the metadata name, tasks, statistics of the frames."""

from collections.abc import Iterator

import numpy as np

from ..exceptions import CopolicyError
from ..features import FEATURES
from .episode_table import EpisodeTable
from .finding import Finding
from .limits import limit
from .rule import Rule


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
    from ..lerobot_folder.loading import STATISTICS, numbers, read_statistics, statistics_problems

    problems = list(statistics_problems(table.root, table.info))
    for problem in problems:
        yield Finding("", "frame_statistics", None, None, "error", problem.message)
    if problems or len(table.framed) < len(table.labels):
        return
    try:
        stored = read_statistics(table.root)
    except CopolicyError:
        return
    bound = limit("frame_statistics")
    # LeRobot's merge leaves those of the running numbers (index, episode_index) as they were in the parts.
    for name, values in ((name, values) for name, values in table.frames.items() if name in FEATURES):
        rows = values.reshape(table.frame_count, -1).astype(float)
        if name not in stored or not np.isfinite(rows).all():
            continue  # said by `finite`
        figures = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
        scale = 1 + np.abs(rows).max()
        for kind in STATISTICS:
            off = float(np.abs(numbers(stored[name][kind], None) - figures[kind]).max() / scale)
            if not off <= bound:
                message = f"the {kind} of {name} in meta/stats.json is not that of the frames, relative to their size"
                yield Finding("", "frame_statistics", off, bound, "error", message)
                break
        count = int(np.asarray(stored[name]["count"]).reshape(-1)[0])
        if count != len(rows):
            message = f"the count of {name} in meta/stats.json is not that of the frames"
            yield Finding("", "frame_statistics", count, len(rows), "error", message)


RULES = (
    Rule("loading", "every episode's files are where the metadata say", _files, kinds=("lerobot",), whole=True),
    Rule("tasks", "the sentences of the tasks are there", _tasks, ("task_index",), kinds=("lerobot",), whole=True),
    Rule("frame_statistics", "meta/stats.json describes the frames", _statistics, kinds=("lerobot",), whole=True),
)
