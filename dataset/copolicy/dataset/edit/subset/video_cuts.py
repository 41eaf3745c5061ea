"""Copies the video packets of some episodes of a data set to new files, without encoding again."""

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
_WRITE_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def cut_videos(
    root: Path, key: str, episodes: Sequence[Row], selected: Sequence[int], folder: Path, info: dict[str, Any]
) -> dict[int, Row]:
    """Writes the video files of one feature with the frames of the selected episodes only.

    Each file of the data set gives one file, because the frames of a file share the header that a decoder needs; a
    file whose episodes are all selected is copied unchanged.

    Args:
        episodes: all rows of meta/episodes with the columns `length` and `videos/KEY/...`.
        selected: indices into `episodes`.
        folder: folder of the new data set.
        info: `meta/info.json`.

    Returns:
        The columns `videos/KEY/...` of the new row by selected index.

    Raises:
        FileFormatError: a file lacks frames, or an episode in it does not begin with a key frame.
        MissingExtraError: PyAV is not installed.
    """
    by_file: dict[FileIndex, list[int]] = defaultdict(list)
    for index, row in enumerate(episodes):
        by_file[row[f"videos/{key}/chunk_index"], row[f"videos/{key}/file_index"]].append(index)
    selected_indices = set(selected)
    columns: dict[int, Row] = {}
    target: FileIndex | None = None
    for _, indices in sorted(by_file.items()):
        to_copy = sorted(selected_indices & set(indices), key=lambda i: (_start(episodes[i], key), i))
        if not to_copy:
            continue
        target = next_index(target, info)
        path = chunk_file(folder / "videos" / key, target, "mp4")
        path.parent.mkdir(parents=True, exist_ok=True)
        video, *_ = video_span(root, info, episodes[to_copy[0]], key)
        if len(to_copy) == len(indices):
            shutil.copyfile(video, path)
            times = [(_start(episodes[index], key), episodes[index][f"videos/{key}/to_timestamp"]) for index in to_copy]
        else:
            times = _copy_packets(video, path, [episodes[index] for index in to_copy], key, info["fps"])
        for index, (start, end) in zip(to_copy, times, strict=True):
            columns[index] = {
                f"videos/{key}/chunk_index": target[0],
                f"videos/{key}/file_index": target[1],
                f"videos/{key}/from_timestamp": start,
                f"videos/{key}/to_timestamp": end,
            }
    return columns


def _start(row: Row, key: str) -> float:
    return row[f"videos/{key}/from_timestamp"]


def _copy_packets(source: Path, target: Path, rows: Sequence[Row], key: str, fps: float) -> list[tuple[float, float]]:
    """Copies the packets of some episodes in the order of the file; returns start and end (s) of each."""
    try:
        import av
        from av.error import FFmpegError
    except ModuleNotFoundError:
        raise MissingExtraError("av") from None
    half_frame = 0.5 / fps  # timestamps in containers are rounded
    times: list[tuple[float, float]] = []
    counts = [0] * len(rows)
    frames = 0
    try:
        with av.open(str(source)) as input_file, av.open(str(target), "w", format="mp4") as output_file:
            stream: Any = input_file.streams.video[0]
            output_stream: Any = output_file.add_stream_from_template(stream, opaque=True)
            output_stream.time_base = stream.time_base
            current_row, shift = -1, 0
            for packet in input_file.demux(stream):
                if not packet.size or packet.pts is None:
                    continue
                time = float(packet.pts * stream.time_base)
                row_number = next(
                    (n for n, row in enumerate(rows)
                     if _start(row, key) - half_frame <= time < row[f"videos/{key}/to_timestamp"] - half_frame),
                    None,
                )  # fmt: skip
                if row_number is None:
                    continue
                if row_number != current_row:
                    if counts[row_number] or not packet.is_keyframe:
                        expected = f"a key frame at the start of episode {rows[row_number]['episode_index']}"
                        raise FileFormatError(source, expected, "a frame that depends on earlier frames")
                    current_row, shift = row_number, round(frames / fps / stream.time_base) - packet.pts
                    times.append((frames / fps, (frames + rows[row_number]["length"]) / fps))
                    frames += rows[row_number]["length"]
                counts[row_number] += 1
                packet.pts += shift
                packet.dts = None if packet.dts is None else packet.dts + shift
                packet.stream = output_stream
                output_file.mux(packet)
    except (FFmpegError, IndexError) as error:
        if isinstance(error, OSError) and error.errno in _WRITE_ERRORS:
            raise OSError(error.errno, os.strerror(error.errno), str(target)) from None
        raise FileFormatError(source, "a video", str(error) or "no frame") from None
    for row, count in zip(rows, counts, strict=True):
        if count != row["length"]:
            expected = f"{row['length']} frames of episode {row['episode_index']}"
            raise FileFormatError(source, expected, str(count))
    return times
