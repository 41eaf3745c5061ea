"""Checks that LeRobot can load single episodes, merge data sets and normalise their frames."""

import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array
from ..exceptions import CopolicyError, FileFormatError
from ..files.json_file import read_json
from ..files.listing import visible_files
from ..files.meta_files import EPISODES_FOLDER, STATS_FILE, TASKS_FILE
from .folder import POSITIONS, LeRobotFolder
from .info import episode_files
from .references import data_path, read_tasks, tasks_are_indexed, video_features, video_span
from .tables import (
    ColumnError,
    column_types,
    episode_values,
    is_list,
    pa,
    read_parquet,
    row_count,
    scalars,
    type_mismatch,
    vectors,
)

STATISTICS = ("min", "max", "mean", "std")
"""The statistics of a feature that normalisation may use."""


class FolderProblem(NamedTuple):
    """A problem that prevents LeRobot from loading a data set or one of its episodes.

    Attributes:
        episode: `episode_index`; None if the problem concerns all episodes.
    """

    episode: int | None
    message: str


def require_loadable(root: Path, finite_statistics: bool = True) -> LeRobotFolder:
    """Checks that LeRobot can load every episode of a data set, whatever its task.

    Args:
        finite_statistics: refuse NaN in `meta/stats.json`, which an unused episode may have caused.

    Raises:
        FileFormatError: LeRobot cannot load it; the message gives the first problem.
    """
    folder = LeRobotFolder.open(root)
    info = folder.info
    for name, expected in ((EPISODES_FOLDER, info["total_episodes"]), ("data", info["total_frames"])):
        rows = sum(row_count(path) for path in visible_files(root / name, "*.parquet"))
        if rows != expected:
            raise FileFormatError(root / name, f"{expected} rows, as meta/info.json says", f"{rows}")
    for name in POSITIONS:
        episode_values(folder.episodes, name, "int", root / EPISODES_FOLDER)
    _require_spans(folder)
    episodes_of_files: dict[str, frozenset[int]] = {}
    task_numbers: set[int] = set()
    for path in folder.data_files:
        types = column_types(path)
        stored = [name for name, feature in info["features"].items() if feature["dtype"] != "video"]
        if missing := [name for name in stored if name not in types]:
            raise FileFormatError(path, "the features of meta/info.json", f"no column {missing[0]}")
        if missing := [name for name in ("episode_index", "index", "task_index", "timestamp") if name not in types]:
            raise FileFormatError(path, "the columns of a LeRobot data set", f"no column {missing[0]}")
        _require_features(path, info["features"])
        table = read_parquet(path, ["episode_index", "task_index"])
        numbers, tasks = (_whole_numbers(table, name, path) for name in table.column_names)
        episodes_of_files[path.relative_to(root).as_posix()] = frozenset(np.unique(numbers).tolist())
        task_numbers.update(np.unique(tasks).tolist())
    read_tasks(root)
    read_frame_statistics(root)
    rows = folder.episodes.to_pylist()
    for problems in (
        file_problems(root, info, rows, episodes_of_files),
        task_problems(root, info, rows, task_numbers),
        statistics_problems(root, info, finite_statistics),
        episode_statistics_problems(root),
    ):
        for problem in problems:
            prefix = "" if problem.episode is None else f"episode {problem.episode}: "
            raise FileFormatError(root, "a data set that LeRobot can load", f"{prefix}{problem.message}")
    return folder


def _require_spans(folder: LeRobotFolder) -> None:
    """Checks that `dataset_from_index` and `dataset_to_index` assign every frame to one episode."""
    first, end = (folder.episodes.column(name).to_numpy() for name in POSITIONS[2:])
    lengths = np.asarray(folder.lengths)
    wrong = np.flatnonzero(end - first != lengths)
    if not len(wrong):
        order = np.argsort(first, kind="stable")
        wrong = order[first[order] != np.cumsum(lengths[order]) - lengths[order]]
    if len(wrong):
        episode = int(wrong[0])
        expected = f"consecutive episodes, episode {episode} with {lengths[episode]} frames"
        found = f"dataset_from_index {first[episode]} and dataset_to_index {end[episode]}"
        raise FileFormatError(folder.root / EPISODES_FOLDER, expected, found)


def _require_features(path: Path, features: Mapping[str, Any]) -> None:
    """Checks that the columns of a data file fit their features, because LeRobot casts each column to its feature."""
    for name, feature in features.items():
        dtype, shape = feature["dtype"], feature["shape"]
        if not dtype.startswith(("float", "int", "uint", "bool")) or len(shape) != 1:
            continue
        found = type_mismatch(read_parquet(path, [name]).column(name), dtype, shape)
        if found:
            expected = f"{math.prod(shape)} numbers" if math.prod(shape) > 1 else "a number"
            raise FileFormatError(path, f"{expected} of type {dtype} in every row of {name}", found)


def file_problems(
    root: Path, info: Mapping[str, Any], rows: Collection[dict[str, Any]], data_files: Mapping[str, frozenset[int]]
) -> Iterator[FolderProblem]:
    """Yields the episodes whose files are not where the metadata say.

    Args:
        rows: rows of meta/episodes.
        data_files: the episodes in each data file, by its path relative to the folder.
    """
    for row in rows:
        index = row["episode_index"]
        try:
            name = data_path(info, row)
        except ValueError as error:
            yield FolderProblem(index, f"the metadata do not name the file of the frames: {error}")
            continue
        if name not in data_files:
            yield FolderProblem(index, f"the frames should be in {name}, which is missing or cannot be read")
        elif index not in data_files[name]:
            yield FolderProblem(index, f"the frames should be in {name}, which has no frame of this episode")
        for key in video_features(info):
            try:
                _, start, end = video_span(root, info, row, key)
            except CopolicyError as error:
                yield FolderProblem(index, _relative_message(root, error))
                continue
            expected = row["length"] / info["fps"]
            if abs(end - start - expected) > 0.5 / info["fps"]:
                yield FolderProblem(index, f"{expected:g} s of frames, but {end - start:g} s of the video {key}")


def task_problems(
    root: Path, info: Mapping[str, Any], rows: Collection[dict[str, Any]], numbers: Collection[int]
) -> Iterator[FolderProblem]:
    """Yields the problems of `meta/tasks.parquet`, whose sentences LeRobot looks up by row.

    Args:
        numbers: every `task_index` of the frames.
    """
    try:
        tasks = read_tasks(root)
    except CopolicyError as error:
        yield FolderProblem(None, _relative_message(root, error))
        return
    name = TASKS_FILE
    if list(tasks) != list(range(len(tasks))) or not all(text.strip() for text in tasks.values()):
        yield FolderProblem(None, f"{name} does not number its sentences 0, 1, ...: {list(tasks)[:5]}")
    if not tasks_are_indexed(root / TASKS_FILE):
        yield FolderProblem(None, f"{name} does not have its sentences as the pandas index, where LeRobot reads them")
    if info.get("total_tasks") != len(tasks):
        yield FolderProblem(None, f"meta/info.json has total_tasks {info.get('total_tasks')}, {name} {len(tasks)} rows")
    unknown = sorted(set(numbers) - set(tasks))
    if unknown:
        yield FolderProblem(None, f"frames name task {unknown[0]}, which {name} does not have")
    for row in rows:
        texts = row.get("tasks")
        if not isinstance(texts, list) or not texts or not {str(text) for text in texts} <= set(tasks.values()):
            message = f"meta/episodes names no task of the data set: {str(texts)[:80]}"
            yield FolderProblem(row["episode_index"], message)


def statistics_problems(root: Path, info: Mapping[str, Any], finite: bool = True) -> Iterator[FolderProblem]:
    """Yields the problems of `meta/stats.json`.

    Args:
        finite: treat NaN and infinite numbers as problems.
    """
    name = STATS_FILE
    try:
        stored = read_frame_statistics(root)
    except CopolicyError as error:
        yield FolderProblem(None, _relative_message(root, error))
        return
    for key, feature in info["features"].items():
        if feature["dtype"] == "string":
            continue
        if key not in stored:
            yield FolderProblem(None, f"{name} has no statistics of {key}")
            continue
        # Images have one value per channel.
        width = None if feature["dtype"] in ("video", "image") else math.prod(feature["shape"])
        for statistic in dict.fromkeys((*STATISTICS, "count", *stored[key])):
            if number_array(stored[key].get(statistic), 1 if statistic == "count" else width, finite) is None:
                yield FolderProblem(None, f"{name} has no usable {statistic} of {key}")
                break


def episode_statistics_problems(root: Path) -> Iterator[FolderProblem]:
    """Yields the columns `stats/...` of meta/episodes that are not lists of numbers, which merging requires."""
    for path in episode_files(root):
        types = column_types(path)
        names = [name for name in types if name.startswith("stats/") and _is_flat(types[name])]
        table = read_parquet(path, names)
        for name in names:
            if not is_list(types[name]):
                message = f"{name} of meta/episodes: expected a list of numbers in every row, found {types[name]}"
                yield FolderProblem(None, message)
                continue
            try:
                vectors(table.column(name))
            except ColumnError as error:
                yield FolderProblem(None, f"{name} of meta/episodes: expected {error.expected}, found {error.found}")


def read_frame_statistics(root: Path) -> dict[str, dict[str, Any]]:
    """Reads `meta/stats.json`.

    Raises:
        FileFormatError: no such file, or another structure.
    """
    return read_json(root / STATS_FILE, dict[str, dict[str, Any]], "statistics of the frames")


def number_array(value: Any, width: int | None, finite: bool = True) -> Array | None:
    """Converts a JSON value to a flat array of numbers; None if they are not finite or not `width` many."""
    if isinstance(value, str | bool) or value is None:
        return None
    try:
        array = np.asarray(value, float).reshape(-1)
    except (TypeError, ValueError):
        return None
    if not array.size or (finite and not np.isfinite(array).all()) or (width is not None and array.size != width):
        return None
    return array


def _is_flat(column_type: pa.DataType) -> bool:
    """Whether a column is not nested; statistics of images are nested lists."""
    return not (pa.types.is_list(column_type) and pa.types.is_nested(column_type.value_type))


def _whole_numbers(table: pa.Table, name: str, path: Path) -> Array:
    try:
        return scalars(table.column(name), "int")
    except ColumnError as error:
        raise FileFormatError(path, f"{error.expected} of {name}", error.found) from None


def _relative_message(root: Path, error: CopolicyError) -> str:
    """An error's message with paths relative to the data set's folder."""
    return str(error).replace(f"{root}/", "").removeprefix(f"{root}: ")
