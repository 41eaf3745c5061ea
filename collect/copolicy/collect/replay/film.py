"""A replay as a film: H.264 through PyAV or the ffmpeg program, or a GIF through Pillow."""

import contextlib
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, MissingExtraError, OutputExistsError, RunError
from copolicy.dataset.files.staging import new_file

from ..sdl import pygame
from .pictures import picture_count, picture_size, pictures
from .track import Track

VIDEO_WIDTH, VIDEO_FPS = 1200, 30
GIF_WIDTH, GIF_FPS = 600, 12

_CONTAINERS = {".mp4": "mp4", ".mkv": "matroska"}
_QUALITY = "20"  # of x264, 0 (lossless) to 51
_PRESET = "veryfast"


def write_video(
    track: Track, path: Path, speed: float = 1.0, width: int | None = None, fps: int | None = None
) -> dict[str, Any]:
    """Writes an H.264 video that plays everywhere.

    Args:
        track: what to show.
        path: of the file, `.mp4` or `.mkv`.
        speed: times real time.
        width: px.
        fps: pictures a second.

    Returns:
        Size, pictures and seconds of the film, JSON-able.

    Raises:
        OutputExistsError: the file exists.
        InvalidValueError: another ending, or a speed, width or rate that makes no film.
        CopolicyError: neither PyAV nor ffmpeg is there.
        RunError: the encoder failed.
    """
    size, fps, frames = _film(track, path, tuple(_CONTAINERS), speed, width or VIDEO_WIDTH, fps or VIDEO_FPS)
    encode = video_encoder()
    with new_file(path) as unfinished:
        try:
            encode(unfinished, _CONTAINERS[path.suffix.lower()], frames, size, fps)
        except RunError as error:
            # The hidden file is gone when somebody reads this.
            raise RunError(str(error).replace(unfinished.name, path.name)) from None
    return _summary(path, track, size, fps, speed)


def write_gif(
    track: Track, path: Path, speed: float = 1.0, width: int | None = None, fps: int | None = None
) -> dict[str, Any]:
    """Writes an endless GIF; arguments, result and errors as for `write_video`.

    Raises:
        MissingExtraError: Pillow is not there.
    """
    size, fps, frames = _film(track, path, (".gif",), speed, width or GIF_WIDTH, fps or GIF_FPS)
    save_gif(frames, path, size, fps)
    return _summary(path, track, size, fps, speed)


def save_gif(frames: Iterable[pygame.Surface], path: Path, size: tuple[int, int], fps: int, colours: int = 256) -> None:
    """Writes pictures as an endless GIF.

    Args:
        frames: the pictures; the palette is that of the first one.
        path: of the file, which must not exist.
        size: of a picture, px.
        fps: pictures a second.
        colours: in the palette, at most 256; fewer make a smaller file.

    Raises:
        OutputExistsError: the file exists.
        MissingExtraError: Pillow is not there.
    """
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("Pillow") from None
    # One palette for all pictures, without dithering: what stands still then compresses to nothing.
    palette = None
    images = []
    for surface in frames:
        image = Image.frombytes("RGB", size, pygame.image.tobytes(surface, "RGB"))
        if palette is None:
            palette = image.quantize(colours)
        images.append(image.quantize(palette=palette, dither=Image.Dither.NONE))
    with new_file(path) as unfinished:
        images[0].save(
            unfinished, format="GIF", save_all=True, append_images=images[1:], duration=round(1000 / fps), loop=0
        )


def _film(
    track: Track, path: Path, endings: tuple[str, ...], speed: float, width: int, fps: int
) -> tuple[tuple[int, int], int, Iterable[pygame.Surface]]:
    """Size, rate and pictures of a film that can be written to a path."""
    if path.suffix.lower() not in endings:
        raise InvalidValueError(str(path), f"a name that ends with {' or '.join(endings)}", path.suffix)
    if path.exists():
        raise OutputExistsError(path)
    if not 0.05 <= speed <= 100:
        raise InvalidValueError("speed", "0.05 to 100", speed)
    if not 1 <= fps <= 120:
        raise InvalidValueError("fps", "1 to 120", fps)
    size = picture_size(width)
    return size, fps, progress(pictures(track, size, fps, speed), picture_count(track, fps, speed), "pictures")


def _summary(path: Path, track: Track, size: tuple[int, int], fps: int, speed: float) -> dict[str, Any]:
    count = picture_count(track, fps, speed)
    return {
        "out": str(path),
        "bytes": path.stat().st_size,
        "width": size[0],
        "height": size[1],
        "pictures": count,
        "seconds": round(count / fps, 3),
    }


def video_encoder():
    """What encodes a film here.

    Raises:
        CopolicyError: neither PyAV nor ffmpeg is there.
    """
    try:
        import av

        # A build of PyAV without x264 cannot write what we want; ffmpeg may.
        if "libx264" in av.codecs_available:
            return _encode_with_pyav
    except ImportError:
        pass
    if shutil.which("ffmpeg"):
        return _encode_with_ffmpeg
    raise CopolicyError("video: expected PyAV (pip install av) or the program ffmpeg, found neither")


def _encode_with_pyav(
    path: Path, container: str, frames: Iterable[pygame.Surface], size: tuple[int, int], fps: int
) -> None:
    import av
    from av.error import FFmpegError

    try:
        with av.open(str(path), "w", format=container, options={"movflags": "+faststart"}) as film:
            stream = film.add_stream("libx264", rate=Fraction(fps), options={"crf": _QUALITY, "preset": _PRESET})
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            for surface in frames:
                frame = av.VideoFrame.from_ndarray(pygame.surfarray.array3d(surface).swapaxes(0, 1), format="rgb24")
                film.mux(stream.encode(frame))
            film.mux(stream.encode())
    except OSError:
        raise
    except FFmpegError as error:
        raise RunError(f"{path.name}: expected PyAV to encode the video, found {error}") from None


def _encode_with_ffmpeg(
    path: Path, container: str, frames: Iterable[pygame.Surface], size: tuple[int, int], fps: int
) -> None:
    command = [
        "ffmpeg", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}",
        "-r", str(fps), "-i", "-", "-c:v", "libx264", "-preset", _PRESET, "-crf", _QUALITY, "-pix_fmt", "yuv420p",
        "-movflags", "+faststart", "-f", container, str(path),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=errors)
        assert process.stdin is not None
        with process, contextlib.suppress(BrokenPipeError), process.stdin as pipe:
            for surface in frames:
                pipe.write(pygame.image.tobytes(surface, "RGB"))
        if process.returncode:
            errors.seek(0)
            told = errors.read().decode(errors="replace").strip().splitlines()
            raise RunError(f"{path.name}: expected ffmpeg to encode the video, found {(told or ['nothing said'])[-1]}")
