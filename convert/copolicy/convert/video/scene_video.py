"""The feature `observation.images.scene`: the table on its map as a film, one picture a frame of the data set.

Each episode is encoded by itself, by one thread and without pictures that refer to later ones: its packets are the
same whatever stands before or after it in a file, so that the content hash does not depend on the layout. Nor does it
depend on the processor: x264 and FFmpeg's conversion of colours choose their arithmetic by the instructions that the
processor has, and round differently; x264 is told not to, and colours are converted here.
"""

import io
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError, RunError
from copolicy.dataset.features import SCENE_IMAGE, SCENE_SIDES

from ..column_statistics import QUANTILES

try:
    import av
    import av.logging
    from av.error import FFmpegError
    from lerobot.configs import RGBEncoderConfig
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None

SCENE = SCENE_IMAGE
"""Name of the feature."""

VideoSize = tuple[int, int]
"""Width and height, px."""

_SAMPLED = 4  # every so many pixels of a row and of a column go into the statistics
_LEVELS = 256
# Parts of red, green and blue in Y, Cb and Cr, of 65,536, for values from 16 to 235 and to 240.
_LUMA, _BLUE, _RED = (16829, 33039, 6416), (-9714, -19070, 28784), (28784, -24103, -4681)


@dataclass(frozen=True)
class SceneClip:
    """One episode's film.

    Attributes:
        mp4: the bytes of a file of its own.
        size: of the pictures.
        statistics: as LeRobot keeps them of pictures, `(3, 1, 1)` in [0, 1]; `count` is `(1,)`.
    """

    mp4: bytes
    size: VideoSize
    statistics: dict[str, np.ndarray]


def parse_size(text: str) -> VideoSize:
    """`600x300` as width and height.

    Raises:
        InvalidValueError: no two even numbers from 64 to 3840.
    """
    width, _, height = text.partition("x")
    size = tuple(int(part) if part.isdecimal() else 0 for part in (width, height))
    shortest, longest = SCENE_SIDES
    if any(side % 2 or not shortest <= side <= longest for side in size):
        raise InvalidValueError("--video-size", f"WIDTHxHEIGHT in even px from {shortest} to {longest}", text)
    return size[0], size[1]


def scene_encoder(fps: int) -> RGBEncoderConfig:
    """How scenes are encoded: H.264, which browsers play, with a key picture a second."""
    # LeRobot tells of the codec each time, which would be a line an episode.
    logging.getLogger(RGBEncoderConfig.__module__).setLevel(logging.WARNING)
    # What stands still costs next to nothing between key pictures; LeRobot's every second one triples the size.
    options = {"bf": 0, "x264-params": "cpu-independent=1"}
    return RGBEncoderConfig(vcodec="h264", g=fps, crf=23, preset="veryfast", extra_options=options)


def scene_feature(size: VideoSize) -> dict:
    """The entry of LeRobot's feature table."""
    return {"dtype": "video", "shape": (size[1], size[0], 3), "names": ["height", "width", "channels"]}


def scene_clip(pictures: Iterable[np.ndarray], fps: int, size: VideoSize) -> SceneClip:
    """Encodes the pictures of an episode, `(height, width, 3)` uint8 each; one is in memory at a time.

    Raises:
        RunError: the encoder failed.
    """
    # PyAV is silent unless told otherwise; LeRobot, when it has looked at a video, lets the encoder talk to stderr.
    av.logging.set_level(None)
    encoder = scene_encoder(fps)
    levels, count = np.zeros((3, _LEVELS), np.int64), 0
    film = io.BytesIO()
    try:
        with av.open(film, "w", format="mp4") as container:
            # One thread: what x264 makes of the pictures depends on how many it has.
            options = encoder.get_codec_options(1, as_strings=True)
            stream: Any = container.add_stream(encoder.vcodec, rate=fps, options=options)
            stream.width, stream.height = size
            stream.pix_fmt = encoder.pix_fmt
            for picture in pictures:
                count += 1
                for channel, counts in enumerate(levels):
                    sampled = picture[::_SAMPLED, ::_SAMPLED, channel]
                    counts += np.bincount(sampled.reshape(-1), minlength=_LEVELS)
                frame = av.VideoFrame.from_ndarray(_yuv420(picture), format=encoder.pix_fmt)
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
    except FFmpegError as error:
        raise RunError(f"--video: expected PyAV to encode the scene, found {error}") from None
    return SceneClip(film.getvalue(), size, _statistics(levels, count))


def _yuv420(picture: np.ndarray) -> np.ndarray:
    """`(height * 3 / 2, width)` the planes of a picture by BT.601, as players take it: chroma of 2 x 2 pixels each."""
    height, width, _ = picture.shape
    colours = np.ascontiguousarray(picture.transpose(2, 0, 1)).astype(np.int32)
    rows = colours[:, ::2] + colours[:, 1::2]
    blocks = rows[..., ::2] + rows[..., 1::2]
    planes = [_mixed(colours, _LUMA, 16) + 16, _mixed(blocks, _BLUE, 18) + 128, _mixed(blocks, _RED, 18) + 128]
    return np.concatenate([plane.ravel() for plane in planes]).astype(np.uint8).reshape(height * 3 // 2, width)


def _mixed(colours: np.ndarray, parts: tuple[int, int, int], bits: int) -> np.ndarray:
    """`(h, w)` the weighted sum of red, green and blue `(3, h, w)`, rounded after a division by `2 ** bits`."""
    red, green, blue = (part * colour for part, colour in zip(parts, colours, strict=True))
    return (red + green + blue + (1 << bits - 1)) >> bits


def _statistics(levels: np.ndarray, frames: int) -> dict[str, np.ndarray]:
    """Exact statistics of the sampled pixels from how often each of 256 levels occurs, `(3, 256)`."""
    values = np.arange(_LEVELS) / (_LEVELS - 1)
    share = levels / levels.sum(axis=1, keepdims=True)
    mean = share @ values
    below = np.cumsum(levels, axis=1)
    rows = {
        "min": values[(levels > 0).argmax(axis=1)],
        "max": values[_LEVELS - 1 - (levels[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(np.maximum(share @ values**2 - mean**2, 0)),
    }
    for name, quantile in QUANTILES.items():
        wanted = np.ceil(quantile * below[:, -1:])
        rows[name] = values[(below >= wanted).argmax(axis=1)]
    return {**{name: row.reshape(3, 1, 1) for name, row in rows.items()}, "count": np.array([frames])}
