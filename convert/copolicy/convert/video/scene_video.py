"""Encodes the feature `observation.images.scene`: a video of the scene, one image per frame of the data set.

Each episode is encoded separately, by one thread and without B-frames: its packets do not depend on its neighbours in
the file, so the content hash does not depend on the layout. Nor does it depend on the processor: x264 and FFmpeg's
colour conversion select arithmetic by the processor's instruction set and round differently, so x264 runs with
`cpu-independent`, and colours are converted here.
"""

import io
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
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

_SAMPLING = 4  # every fourth pixel of a row and of a column enters the statistics
_LEVELS = 256
# BT.601 weights of red, green and blue in Y, Cb and Cr times 65,536, for Y from 16 to 235, Cb and Cr from 16 to 240.
_LUMA, _BLUE, _RED = (16829, 33039, 6416), (-9714, -19070, 28784), (28784, -24103, -4681)


@dataclass(frozen=True)
class SceneClip:
    """The encoded video of one episode.

    Attributes:
        mp4: bytes of a complete mp4 file.
        size: width and height of the images, px.
        statistics: LeRobot's image statistics, `(3, 1, 1)` in [0, 1]; `count` is `(1,)`.
    """

    mp4: bytes
    size: VideoSize
    statistics: dict[str, Array]


def parse_size(text: str) -> VideoSize:
    """Parses a size such as `600x300` to width and height.

    Raises:
        InvalidValueError: not two even numbers within `SCENE_SIDES`.
    """
    width, _, height = text.partition("x")
    size = tuple(int(part) if part.isdecimal() else 0 for part in (width, height))
    shortest, longest = SCENE_SIDES
    if any(side % 2 or not shortest <= side <= longest for side in size):
        raise InvalidValueError("--video-size", f"WIDTHxHEIGHT in even px from {shortest} to {longest}", text)
    return size[0], size[1]


def scene_encoder(fps: int) -> RGBEncoderConfig:
    """Returns the encoder settings: H.264, which browsers play, with one key frame per second."""
    # LeRobot logs the codec at each construction, which would be a line per episode.
    logging.getLogger(RGBEncoderConfig.__module__).setLevel(logging.WARNING)
    # LeRobot's default, a key frame at every second frame, triples the size: static parts compress well between them.
    options = {"bf": 0, "x264-params": "cpu-independent=1"}
    return RGBEncoderConfig(vcodec="h264", g=fps, crf=23, preset="veryfast", extra_options=options)


def scene_feature(size: VideoSize) -> dict[str, Any]:
    """Returns the entry of LeRobot's features."""
    return {"dtype": "video", "shape": (size[1], size[0], 3), "names": ["height", "width", "channels"]}


def scene_clip(images: Iterable[Array], fps: int, size: VideoSize) -> SceneClip:
    """Encodes the images of an episode, `(height, width, 3)` uint8 each; one is in memory at a time.

    Raises:
        RunError: the encoder failed.
    """
    # LeRobot enables FFmpeg's log on stderr when it reads a video.
    av.logging.set_level(None)
    encoder = scene_encoder(fps)
    levels, count = np.zeros((3, _LEVELS), np.int64), 0
    buffer = io.BytesIO()
    try:
        with av.open(buffer, "w", format="mp4") as container:
            # One thread: the output of x264 depends on the number of threads.
            options = encoder.get_codec_options(1, as_strings=True)
            stream: Any = container.add_stream(encoder.vcodec, rate=fps, options=options)
            stream.width, stream.height = size
            stream.pix_fmt = encoder.pix_fmt
            for image in images:
                count += 1
                for channel, channel_levels in enumerate(levels):
                    sampled = image[::_SAMPLING, ::_SAMPLING, channel]
                    channel_levels += np.bincount(sampled.reshape(-1), minlength=_LEVELS)
                frame = av.VideoFrame.from_ndarray(_yuv420(image), format=encoder.pix_fmt)
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
    except FFmpegError as error:
        raise RunError(f"--video: expected PyAV to encode the scene, found {error}") from None
    return SceneClip(buffer.getvalue(), size, _statistics(levels, count))


def _yuv420(image: Array) -> Array:
    """Converts an image to its YUV 4:2:0 planes by BT.601, `(height * 3 / 2, width)`: one chroma value per 2 x 2 px."""
    height, width, _ = image.shape
    colours = np.ascontiguousarray(image.transpose(2, 0, 1)).astype(np.int32)
    rows = colours[:, ::2] + colours[:, 1::2]
    blocks = rows[..., ::2] + rows[..., 1::2]
    luma = _weighted_sum(colours, _LUMA, 16) + 16
    planes = [luma, *(_weighted_sum(blocks, weights, 18) + 128 for weights in (_BLUE, _RED))]
    return np.concatenate([plane.ravel() for plane in planes]).astype(np.uint8).reshape(height * 3 // 2, width)


def _weighted_sum(colours: Array, weights: tuple[int, int, int], bits: int) -> Array:
    """Weighted sum of red, green and blue `(3, h, w)`, divided by `2 ** bits` and rounded: `(h, w)`."""
    red, green, blue = (weight * colour for weight, colour in zip(weights, colours, strict=True))
    return (red + green + blue + (1 << bits - 1)) >> bits


def _statistics(levels: Array, frames: int) -> dict[str, Array]:
    """Exact statistics of the sampled pixels from the histogram of their levels, `(3, 256)`."""
    values = np.arange(_LEVELS) / (_LEVELS - 1)
    proportion = levels / levels.sum(axis=1, keepdims=True)
    mean = proportion @ values
    cumulative = np.cumsum(levels, axis=1)
    rows = {
        "min": values[(levels > 0).argmax(axis=1)],
        "max": values[_LEVELS - 1 - (levels[:, ::-1] > 0).argmax(axis=1)],
        "mean": mean,
        "std": np.sqrt(np.maximum(proportion @ values**2 - mean**2, 0)),
    }
    for name, quantile in QUANTILES.items():
        rank = np.ceil(quantile * cumulative[:, -1:])
        rows[name] = values[(cumulative >= rank).argmax(axis=1)]
    return {**{name: row.reshape(3, 1, 1) for name, row in rows.items()}, "count": np.array([frames])}
