"""Cuts the pictures of some episodes out of the video files of a data set, packet by packet, without encoding anew."""

import errno
import os
import shutil
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...exceptions import FileFormatError, MissingExtraError
from ...lerobot_folder.references import FileIndex, chunk_file, next_index, video_span

Row = dict[str, Any]
_NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def cut_videos(
    root: Path, key: str, episodes: Sequence[Row], chosen: Sequence[int], folder: Path, info: dict[str, Any]
) -> dict[int, Row]:
    """Writes the video files of one feature with the pictures of the chosen episodes alone.

    Each file of the data set gives one file, because all pictures of a file share the head that a decoder needs; a
    file of which every episode is chosen is copied as it is.

    Args:
        episodes: all rows of meta/episodes with the columns `length` and `videos/KEY/...`.
        chosen: their places in `episodes`.
        folder: of the new data set.
        info: `meta/info.json`.

    Returns:
        For each chosen place the columns `videos/KEY/...` of its new row.

    Raises:
        FileFormatError: a file lacks pictures, or an episode in it does not begin with a key picture.
        MissingExtraError: PyAV is not installed.
    """
    by_file: dict[FileIndex, list[int]] = defaultdict(list)
    for place, row in enumerate(episodes):
        by_file[row[f"videos/{key}/chunk_index"], row[f"videos/{key}/file_index"]].append(place)
    wanted = set(chosen)
    columns: dict[int, Row] = {}
    target: FileIndex | None = None
    for _, places in sorted(by_file.items()):
        inside = sorted((place for place in places if place in wanted), key=lambda p: _start(episodes[p], key))
        if not inside:
            continue
        target = next_index(target, info)
        path = chunk_file(folder / "videos" / key, target, "mp4")
        path.parent.mkdir(parents=True, exist_ok=True)
        video, *_ = video_span(root, info, episodes[inside[0]], key)
        if len(inside) == len(places):
            shutil.copyfile(video, path)
            times = [(_start(episodes[place], key), episodes[place][f"videos/{key}/to_timestamp"]) for place in inside]
        else:
            times = _cut(video, path, [episodes[place] for place in inside], key, info["fps"])
        for place, (start, end) in zip(inside, times, strict=True):
            columns[place] = {
                f"videos/{key}/chunk_index": target[0],
                f"videos/{key}/file_index": target[1],
                f"videos/{key}/from_timestamp": start,
                f"videos/{key}/to_timestamp": end,
            }
    return columns


def _start(row: Row, key: str) -> float:
    return row[f"videos/{key}/from_timestamp"]


def _cut(source: Path, target: Path, rows: Sequence[Row], key: str, fps: float) -> list[tuple[float, float]]:
    """Moves the packets of some episodes, in the order of the file; from and to (s) of each in the new file."""
    try:
        import av
        from av.error import FFmpegError
    except ModuleNotFoundError:
        raise MissingExtraError("av") from None
    half = 0.5 / fps  # times in containers are rounded
    times: list[tuple[float, float]] = []
    counts = [0] * len(rows)
    frames = 0
    try:
        with av.open(str(source)) as reading, av.open(str(target), "w", format="mp4") as writing:
            stream: Any = reading.streams.video[0]
            copy: Any = writing.add_stream_from_template(stream, opaque=True)
            copy.time_base = stream.time_base
            current, shift = -1, 0
            for packet in reading.demux(stream):
                if not packet.size or packet.pts is None:
                    continue
                time = float(packet.pts * stream.time_base)
                number = next(
                    (n for n, row in enumerate(rows)
                     if _start(row, key) - half <= time < row[f"videos/{key}/to_timestamp"] - half),
                    None,
                )  # fmt: skip
                if number is None:
                    continue
                if number != current:
                    if counts[number] or not packet.is_keyframe:
                        what = f"a key picture at the start of episode {rows[number]['episode_index']}"
                        raise FileFormatError(source, what, "another; its pictures hang on those before")
                    current, shift = number, round(frames / fps / stream.time_base) - packet.pts
                    times.append((frames / fps, (frames + rows[number]["length"]) / fps))
                    frames += rows[number]["length"]
                counts[number] += 1
                packet.pts += shift
                packet.dts = None if packet.dts is None else packet.dts + shift
                packet.stream = copy
                writing.mux(packet)
    except (FFmpegError, IndexError) as error:
        if isinstance(error, OSError) and error.errno in _NOT_WRITTEN:
            raise OSError(error.errno, os.strerror(error.errno), str(target)) from None
        raise FileFormatError(source, "a video", str(error) or "no picture") from None
    for row, count in zip(rows, counts, strict=True):
        if count != row["length"]:
            what = f"{row['length']} pictures of episode {row['episode_index']}"
            raise FileFormatError(source, what, str(count))
    return times
