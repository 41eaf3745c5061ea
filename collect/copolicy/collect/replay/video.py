"""A replay as a video: H.264 through PyAV or the ffmpeg program, or a GIF through Pillow."""

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
from .frames import frame_count, frame_size, render_frames
from .track import Track

VIDEO_WIDTH, VIDEO_FPS = 1200, 30
GIF_WIDTH, GIF_FPS = 600, 12

_CONTAINERS = {".mp4": "mp4", ".mkv": "matroska"}
_QUALITY = "20"  # of x264, 0 (lossless) to 51
_PRESET = "veryfast"


def write_video(
    track: Track, path: Path, speed: float = 1.0, width: int | None = None, fps: int | None = None
) -> dict[str, Any]:
    """Writes an H.264 video, 8 bit 4:2:0, which common players support.

    Args:
        track: to show.
        path: of the file, `.mp4` or `.mkv`.
        speed: times real time.
        width: px.
        fps: frames per second.

    Returns:
        Size, number of frames and seconds of the video, JSON-able.

    Raises:
        OutputExistsError: the file exists.
        InvalidValueError: the suffix, speed, width or rate is invalid.
        CopolicyError: neither PyAV nor ffmpeg is installed.
        RunError: the encoder failed.
    """
    size, fps, frames = _checked_frames(track, path, tuple(_CONTAINERS), speed, width or VIDEO_WIDTH, fps or VIDEO_FPS)
    encode = video_encoder()
    with new_file(path) as unfinished:
        try:
            encode(unfinished, _CONTAINERS[path.suffix.lower()], frames, size, fps)
        except RunError as error:
            # Names the final file, since the unfinished one is removed.
            raise RunError(str(error).replace(unfinished.name, path.name)) from None
    return _summary(path, track, size, fps, speed)


def write_gif(
    track: Track, path: Path, speed: float = 1.0, width: int | None = None, fps: int | None = None
) -> dict[str, Any]:
    """Writes a looping GIF; arguments, result and errors as for `write_video`.

    Raises:
        MissingExtraError: Pillow is not installed.
    """
    size, fps, frames = _checked_frames(track, path, (".gif",), speed, width or GIF_WIDTH, fps or GIF_FPS)
    save_gif(frames, path, size, fps)
    return _summary(path, track, size, fps, speed)


def save_gif(frames: Iterable[pygame.Surface], path: Path, size: tuple[int, int], fps: int, colours: int = 256) -> None:
    """Writes frames as a looping GIF.

    Args:
        frames: of which the first one sets the palette.
        path: of the file, which must not exist.
        size: of a frame, px.
        fps: frames per second.
        colours: in the palette, at most 256; fewer make a smaller file.

    Raises:
        OutputExistsError: the file exists.
        MissingExtraError: Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtraError("Pillow") from None
    # One palette for all frames, without dithering: unchanged areas then compress well.
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


def _checked_frames(
    track: Track, path: Path, suffixes: tuple[str, ...], speed: float, width: int, fps: int
) -> tuple[tuple[int, int], int, Iterable[pygame.Surface]]:
    """Checks path and settings; returns size, rate and frames of the video."""
    if path.suffix.lower() not in suffixes:
        raise InvalidValueError(str(path), f"a name that ends with {' or '.join(suffixes)}", path.suffix)
    if path.exists():
        raise OutputExistsError(path)
    if not 0.05 <= speed <= 100:
        raise InvalidValueError("speed", "0.05 to 100", speed)
    if not 1 <= fps <= 120:
        raise InvalidValueError("fps", "1 to 120", fps)
    size = frame_size(width)
    return size, fps, progress(render_frames(track, size, fps, speed), frame_count(track, fps, speed), "frames")


def _summary(path: Path, track: Track, size: tuple[int, int], fps: int, speed: float) -> dict[str, Any]:
    count = frame_count(track, fps, speed)
    return {
        "out": str(path),
        "bytes": path.stat().st_size,
        "width": size[0],
        "height": size[1],
        "frames": count,
        "seconds": round(count / fps, 3),
    }


def video_encoder():
    """Returns a function that encodes a video with PyAV or ffmpeg.

    Raises:
        CopolicyError: neither PyAV nor ffmpeg is installed.
    """
    try:
        import av

        # Some builds of PyAV lack x264, which ffmpeg may have.
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
        with av.open(str(path), "w", format=container, options={"movflags": "+faststart"}) as output:
            stream = output.add_stream("libx264", rate=Fraction(fps), options={"crf": _QUALITY, "preset": _PRESET})
            stream.width, stream.height = size
            stream.pix_fmt = "yuv420p"
            for surface in frames:
                frame = av.VideoFrame.from_ndarray(pygame.surfarray.array3d(surface).swapaxes(0, 1), format="rgb24")
                output.mux(stream.encode(frame))
            output.mux(stream.encode())
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
            lines = errors.read().decode(errors="replace").strip().splitlines()
            raise RunError(f"{path.name}: expected ffmpeg to encode the video, found {(lines or ['no message'])[-1]}")
