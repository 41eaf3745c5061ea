"""Sources of trajectories that commands take: data sets, results, and folders of a cross-play, by method."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.meta_files import INFO_FILE

from .trajectories import SUFFIX, Trajectories, Trajectory, demonstrations, read_trajectories

CELLS = "cells"
"""Folder of a cross-play with a file for each robot and partner."""


def read_methods(sources: Sequence[str]) -> dict[str, Trajectories]:
    """The episodes of each method by name.

    Args:
        sources: `[NAME=]PATH`: a data set (named by its folder), a result or trajectories file, or the folder of a
            cross-play; the robots of a file are separate methods if there are several, or if it has no NAME.

    Raises:
        FileFormatError: a path is none of these.
        InvalidValueError: two methods of one name, or of different tasks.
    """
    methods: dict[str, Trajectories] = {}
    for text in sources:
        name, sign, path = text.partition("=")
        if not sign or "/" in name or Path(text).exists():
            name, path = "", text
        for method, found in _read(Path(path), name).items():
            if method in methods:
                raise InvalidValueError("sources", "methods of different names (NAME=SOURCE gives one)", method)
            methods[method] = found
    tasks = {name: found.task.spec.name for name, found in methods.items()}
    if len(set(tasks.values())) > 1:
        raise InvalidValueError("sources", "episodes of one task", tasks)
    return methods


def common_rate(methods: Mapping[str, Trajectories], largest: int) -> int:
    """The largest rate up to `largest` that divides those of all episodes, frames per second."""
    rates = {episode.fps for method in methods.values() for episode in method.episodes}
    return next(rate for rate in range(largest, 0, -1) if all(each % rate == 0 for each in rates))


def _read(path: Path, name: str) -> dict[str, Trajectories]:
    if (path / INFO_FILE).is_file():
        return {name or path.name: demonstrations(path)}
    if (path / CELLS).is_dir():
        files = sorted((path / CELLS).glob(f"*{SUFFIX}"))
        if not files:
            raise FileFormatError(path / CELLS, f"files *{SUFFIX} (--trajectories of cross-play)", "none")
        return _by_robot([read_trajectories(file) for file in files], name)
    if path.is_dir():
        raise FileFormatError(path, "a data set, or the folder of a cross-play", "neither")
    return _by_robot([read_trajectories(path)], name)


def _by_robot(read: Sequence[Trajectories], name: str) -> dict[str, Trajectories]:
    episodes: dict[str, list[Trajectory]] = {}
    labels: dict[str, dict[str, None]] = {}
    for part in read:
        for episode in part.episodes:
            robot = str(episode.columns["robot"])
            episodes.setdefault(robot, []).append(episode)
            labels.setdefault(robot, {})[part.label] = None
    methods = {robot: Trajectories(read[0].task, "; ".join(labels[robot]), found) for robot, found in episodes.items()}
    if len(methods) == 1 and name:
        return {name: next(iter(methods.values()))}
    return {f"{name}-{robot}" if name else robot: method for robot, method in methods.items()}
