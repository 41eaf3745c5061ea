"""Digests of the frames of a data set: one for every episode and feature or video, blind to how files are cut."""

import functools
import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import FileFormatError, MissingExtraError
from ..files.meta_files import INFO_FILE, TASKS_FILE
from ..lerobot_folder.folder import LeRobotFolder
from ..lerobot_folder.tables import column_types, feature_values, read_parquet
from .digests import encode

POSITION_COLUMNS = ("index", "episode_index")
"""Frame columns that only say where a frame stands; verified instead of hashed, as a merge moves them."""


def frame_digests(folder: LeRobotFolder, tasks: dict[int, str]) -> list[dict[str, str]]:
    """For each episode the sha256 of each of its features but the positions and videos.

    Numbers are hashed as little-endian values of the feature's declared type, row by row, with one NaN for all;
    a task by its sentence instead of its number; texts and pictures by `canonical.encode`. One column is in memory
    at a time.

    Args:
        tasks: sentence of each task's number.

    Raises:
        FileFormatError: files that contradict the features, the lengths, or the order of the frames.
    """
    root, files, lengths = folder.root, folder.data_files, folder.lengths
    features = {name: feature for name, feature in folder.info["features"].items() if feature["dtype"] != "video"}
    for path in files:
        names = column_types(path)
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
    index = _numbers(files, "index", "int64", [1])[:, 0]
    order = np.argsort(index, kind="stable")
    if not np.array_equal(index[order], np.arange(sum(lengths))):
        raise FileFormatError(root / "data", f"frames with index 0 to {sum(lengths) - 1}, each once", "others")
    episode = _numbers(files, "episode_index", "int64", [1])[:, 0]
    if not np.array_equal(episode[order], np.repeat(np.arange(len(lengths)), lengths)):
        raise FileFormatError(root / "data", "frames in the episodes that meta/episodes names", "others")
    return order


def _encodable(
    files: list[Path], name: str, feature: dict, tasks: dict[int, str], root: Path
) -> np.ndarray | list[Any]:
    """The values of a feature in the order of the files."""
    if name == "task_index":
        numbers = _numbers(files, name, "int64", [1])[:, 0].tolist()
        unknown = set(numbers) - set(tasks)
        if unknown:
            raise FileFormatError(root / TASKS_FILE, f"task {min(unknown)}", "no such number")
        return [tasks[number] for number in numbers]
    if feature["dtype"] == "string":
        return _values(files, name)
    if feature["dtype"] == "image":
        # The path beside a picture's bytes is a file name of whoever recorded it.
        return [value.get("bytes") if isinstance(value, dict) else value for value in _values(files, name)]
    try:
        np.dtype(feature["dtype"])
    except TypeError:
        found = f"the dtype {feature['dtype']!r} of {name}"
        raise FileFormatError(root / INFO_FILE, "features of known types", found) from None
    numbers = _numbers(files, name, feature["dtype"], feature["shape"])
    if numbers.dtype.kind == "f":
        numbers[np.isnan(numbers)] = np.nan
    return numbers


def _numbers(files: Sequence[Path], name: str, dtype: str, shape: Sequence[int]) -> np.ndarray:
    """A column of numbers over all files, `(rows, n)`, little-endian.

    Raises:
        FileFormatError: a file is damaged, lacks a value, or holds rows of another width.
    """
    kind = np.dtype(dtype).newbyteorder("<")
    parts = (feature_values(read_parquet(path, [name]), name, shape, path) for path in files)
    with np.errstate(invalid="ignore"):  # a value that its declared type cannot hold is said by the checks
        return np.concatenate([part.reshape(len(part), -1).astype(kind) for part in parts])


def _values(files: Sequence[Path], name: str) -> list[Any]:
    """A column of texts or pictures over all files."""
    return [value for path in files for value in read_parquet(path, [name]).column(name).to_pylist()]


def video_digest(path: Path, start: float, end: float, fps: float) -> str:
    """The sha256 of the encoded pictures shown in [start, end) of a file, s.

    The packets are hashed as they are, without decoding: joining videos copies them, encoding anew does not.

    Raises:
        FileFormatError: no video file.
        MissingExtraError: PyAV is not installed.
    """
    total = hashlib.sha256()
    half = 0.5 / fps  # times in containers are rounded
    try:
        status = path.stat()
    except OSError as error:
        raise FileFormatError(path, "a video", error.strerror or str(error)) from None
    for time, packet in _packets(path, (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)):
        if start - half <= time < end - half:
            total.update(packet)
    return total.hexdigest()


@functools.lru_cache(maxsize=4)
def _packets(path: Path, _: tuple[int, ...]) -> tuple[tuple[float, bytes], ...]:
    """Time and sha256 of every packet of the first video stream, in the order they are shown.

    Args:
        _: state of the file: another file may take its place while the program runs.
    """
    try:
        import av
        from av.error import FFmpegError
    except ModuleNotFoundError:
        raise MissingExtraError("av") from None
    packets = []
    try:
        with av.open(str(path)) as container:
            for packet in container.demux(container.streams.video[0]):
                if packet.pts is not None and packet.time_base is not None and packet.size:
                    packets.append((float(packet.pts * packet.time_base), hashlib.sha256(bytes(packet)).digest()))
    except (FFmpegError, IndexError, OSError) as error:
        raise FileFormatError(path, "a video", str(error) or "no picture") from None
    return tuple(sorted(packets))
