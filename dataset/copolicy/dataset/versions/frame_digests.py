"""Digests of the frames of a data set, one for each episode and feature or video, however the files are split."""

import functools
import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..exceptions import FileFormatError, MissingExtraError
from ..files.meta_files import INFO_FILE, TASKS_FILE
from ..lerobot_folder.folder import LeRobotFolder
from ..lerobot_folder.tables import column_types, feature_values, read_parquet
from .digests import encode

POSITION_COLUMNS = ("index", "episode_index")
"""Columns with the position of a frame; they are verified, not hashed, because a merge changes them."""


def frame_digests(folder: LeRobotFolder, tasks: dict[int, str]) -> list[dict[str, str]]:
    """For each episode the sha256 of each feature, except positions and videos.

    Numbers are hashed row by row as little-endian values of the feature's declared type, with one bit pattern for
    every NaN; tasks by their sentence instead of their number; texts and images by `digests.encode`. One column is in
    memory at a time.

    Args:
        tasks: sentence by task number.

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
            chunks: Iterable[bytes] = (
                rows[end - length : end].tobytes() for end, length in zip(ends, lengths, strict=True)
            )
        else:
            rows = [rows[row] for row in order]
            chunks = (encode(rows[end - length : end]) for end, length in zip(ends, lengths, strict=True))
        for episode, chunk in zip(digests, chunks, strict=True):
            episode[name] = hashlib.sha256(encode(name) + chunk).hexdigest()
    return digests


def _order(root: Path, files: list[Path], lengths: Sequence[int]) -> Array:
    """Row numbers, over all files, of the frames with `index` 0, 1, 2, ..."""
    indices = _numbers(files, "index", "int64", [1])[:, 0]
    order = np.argsort(indices, kind="stable")
    if not np.array_equal(indices[order], np.arange(sum(lengths))):
        raise FileFormatError(root / "data", f"frames with index 0 to {sum(lengths) - 1}, each once", "others")
    episode = _numbers(files, "episode_index", "int64", [1])[:, 0]
    if not np.array_equal(episode[order], np.repeat(np.arange(len(lengths)), lengths)):
        raise FileFormatError(root / "data", "frames in the episodes that meta/episodes names", "others")
    return order


def _encodable(files: list[Path], name: str, feature: dict, tasks: dict[int, str], root: Path) -> Array | list[Any]:
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
        # The path stored beside an image's bytes depends on the machine that recorded it.
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


def _numbers(files: Sequence[Path], name: str, dtype: str, shape: Sequence[int]) -> Array:
    """A column of numbers over all files, `(rows, n)`, little-endian.

    Raises:
        FileFormatError: a file is damaged, lacks a value, or holds rows of another width.
    """
    target_dtype = np.dtype(dtype).newbyteorder("<")
    columns = (feature_values(read_parquet(path, [name]), name, shape, path) for path in files)
    with np.errstate(invalid="ignore"):  # the checks report values that do not fit the declared type
        return np.concatenate([column.reshape(len(column), -1).astype(target_dtype) for column in columns])


def _values(files: Sequence[Path], name: str) -> list[Any]:
    """A column of texts or images over all files."""
    return [value for path in files for value in read_parquet(path, [name]).column(name).to_pylist()]


def video_digest(path: Path, start: float, end: float, fps: float) -> str:
    """The sha256 of the encoded frames of a video file in [start, end) seconds.

    Packets are hashed without decoding: joining videos keeps the digest, encoding again changes it.

    Raises:
        FileFormatError: not a video file.
        MissingExtraError: PyAV is not installed.
    """
    digest = hashlib.sha256()
    half_frame = 0.5 / fps  # timestamps in containers are rounded
    try:
        status = path.stat()
    except OSError as error:
        raise FileFormatError(path, "a video", error.strerror or str(error)) from None
    for time, packet in _packets(path, (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)):
        if start - half_frame <= time < end - half_frame:
            digest.update(packet)
    return digest.hexdigest()


@functools.lru_cache(maxsize=4)
def _packets(path: Path, file_state: tuple[int, ...]) -> tuple[tuple[float, bytes], ...]:
    """Time in seconds and sha256 of every packet of the first video stream, in the order of presentation.

    Args:
        file_state: cache key that changes if the file is replaced while the program runs.
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
        raise FileFormatError(path, "a video", str(error) or "no frame") from None
    return tuple(sorted(packets))
