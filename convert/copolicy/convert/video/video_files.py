"""Concatenates the videos of episodes to the video files of a LeRobot v3 data set, without re-encoding."""

import io
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import MissingExtraError, RunError

from ..numbered_files import NumberedFiles

try:
    import av
    from lerobot.datasets.utils import DEFAULT_VIDEO_PATH
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


class VideoFiles(NumberedFiles):
    """The video files of one feature: `videos/KEY/chunk-000/file-000.mp4`, ...

    LeRobot rewrites the whole file at every episode. Here packets are appended to the open file with shifted
    timestamps; memory holds one episode and the index of the file.
    """

    def __init__(self, root: Path, key: str, fps: int, file_mb: float, chunks_size: int):
        super().__init__(root, DEFAULT_VIDEO_PATH.replace("{video_key}", key), file_mb, chunks_size)
        self._key, self._fps = key, fps
        self._frames = self._bytes = 0
        self._stream: Any = None

    def append(self, mp4: bytes, frames: int) -> dict[str, int | float]:
        """Appends an episode's video.

        Args:
            mp4: a file with one video stream; all have the same codec, size and rate.
            frames: expected number of images.

        Returns:
            The columns of meta/episodes: chunk, file, and start and end time (s) of the episode in the file.

        Raises:
            RunError: another number of images.
        """
        with av.open(io.BytesIO(mp4), "r") as source:
            stream = source.streams.video[0]
            packets = [packet for packet in source.demux(stream) if packet.size]
            if len(packets) != frames:
                raise RunError(f"{self._key}: expected {frames} images of an episode, found {len(packets)}")
            if self._writer is not None and self._bytes + len(mp4) >= self._limit:
                self._next()
            if self._writer is None:
                self._open(stream)
            container: Any = self._writer
            assert stream.time_base is not None
            offset = round(self._frames / self._fps / stream.time_base)
            for packet in packets:
                packet.pts = (packet.pts or 0) + offset
                packet.dts = (packet.dts or 0) + offset
                packet.stream = self._stream
                container.mux(packet)
        start, self._frames = self._frames, self._frames + frames
        self._bytes += len(mp4)
        return {
            f"videos/{self._key}/chunk_index": self._chunk,
            f"videos/{self._key}/file_index": self._file,
            f"videos/{self._key}/from_timestamp": start / self._fps,
            f"videos/{self._key}/to_timestamp": self._frames / self._fps,
        }

    def _open(self, example: Any) -> None:
        self._writer = av.open(str(self._new_path()), "w", format="mp4")
        self._stream = self._writer.add_stream_from_template(example, opaque=True)
        self._stream.time_base = example.time_base
        self._frames = self._bytes = 0
