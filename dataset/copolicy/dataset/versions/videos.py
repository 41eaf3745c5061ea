"""Digests of an episode's pictures in video files, blind to which file holds them."""

import functools
import hashlib
from pathlib import Path

from ..exceptions import FileFormatError, MissingExtraError


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
