"""Digests of the frames of a data set: one for every episode and feature, blind to how files are cut."""

import hashlib
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import FileFormatError
from . import parquet
from .canonical import encode

POSITION_COLUMNS = ("index", "episode_index")
"""Frame columns that only say where a frame stands; verified instead of hashed, as a merge moves them."""


def frame_digests(root: Path, info: dict, lengths: Sequence[int], tasks: dict[int, str]) -> list[dict[str, str]]:
    """For each episode the sha256 of each of its features but the positions and videos.

    Numbers are hashed as little-endian values of the feature's declared type, row by row, with one NaN for all;
    a task by its sentence instead of its number; texts and pictures by `canonical.encode`. One column is in memory
    at a time.

    Args:
        info: `meta/info.json`.
        lengths: frames of each episode, in order.
        tasks: sentence of each task's number.

    Raises:
        FileFormatError: files that contradict the features, the lengths, or the order of the frames.
    """
    files = parquet.files_under(root, "data")
    features = {name: feature for name, feature in info["features"].items() if feature["dtype"] != "video"}
    for path in files:
        names = parquet.column_names(path)
        if set(names) != set(features):
            found = ", ".join(sorted(set(names) ^ set(features)))
            raise FileFormatError(path, "the columns that meta/info.json names as features", f"a difference in {found}")
    order = _order(root, files, lengths)
    ends = np.cumsum(lengths)
    digests: list[dict[str, str]] = [{} for _ in lengths]
    for name in sorted(set(features) - set(POSITION_COLUMNS)):
        rows = _encodable(files, name, features[name], tasks, root)
        if isinstance(rows, np.ndarray):
            rows = rows[order]
            parts: Iterable[bytes] = (
                rows[end - length : end].tobytes() for end, length in zip(ends, lengths, strict=True)
            )
        else:
            rows = [rows[place] for place in order]
            parts = (encode(rows[end - length : end]) for end, length in zip(ends, lengths, strict=True))
        for episode, part in zip(digests, parts, strict=True):
            episode[name] = hashlib.sha256(encode(name) + part).hexdigest()
    return digests


def _order(root: Path, files: list[Path], lengths: Sequence[int]) -> np.ndarray:
    """Where the frames of `index` 0, 1, 2, ... stand in the files."""
    index = parquet.read_numbers(files, "index", "int64", 1)[:, 0]
    order = np.argsort(index, kind="stable")
    if not np.array_equal(index[order], np.arange(sum(lengths))):
        raise FileFormatError(root / "data", f"frames with index 0 to {sum(lengths) - 1}, each once", "others")
    episode = parquet.read_numbers(files, "episode_index", "int64", 1)[:, 0]
    if not np.array_equal(episode[order], np.repeat(np.arange(len(lengths)), lengths)):
        raise FileFormatError(root / "data", "frames in the episodes that meta/episodes names", "others")
    return order


def _encodable(
    files: list[Path], name: str, feature: dict, tasks: dict[int, str], root: Path
) -> np.ndarray | list[Any]:
    """The values of a feature in the order of the files."""
    if name == "task_index":
        numbers = parquet.read_numbers(files, name, "int64", 1)[:, 0].tolist()
        unknown = set(numbers) - set(tasks)
        if unknown:
            raise FileFormatError(root / "meta" / "tasks.parquet", f"task {min(unknown)}", "no such number")
        return [tasks[number] for number in numbers]
    if feature["dtype"] == "string":
        return parquet.read_values(files, name)
    if feature["dtype"] == "image":
        # The path beside a picture's bytes is a file name of whoever recorded it.
        return [value["bytes"] if isinstance(value, dict) else value for value in parquet.read_values(files, name)]
    numbers = parquet.read_numbers(files, name, feature["dtype"], math.prod(feature["shape"]))
    if numbers.dtype.kind == "f":
        numbers[np.isnan(numbers)] = np.nan
    return numbers
