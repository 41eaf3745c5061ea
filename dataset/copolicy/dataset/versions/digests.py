"""Digests that data sets are compared by: one for each episode, feature and episode column."""

import hashlib
import math
import struct
from dataclasses import dataclass
from typing import Any

from ..exceptions import InvalidValueError

Value = None | bool | int | float | str | bytes | list | tuple | dict
"""A value of JSON or of a Parquet row."""

_NAN = struct.pack("<d", math.nan)


FORMAT = "copolicy-content-1"
"""Version of the hash algorithm, the prefix of the content hash."""


def encode(value: Value) -> bytes:
    """Encodes a value as bytes: a letter for its type, its length if that varies, its content.

    Integers are decimal digits, floats 8 bytes (little-endian, one bit pattern for every NaN), texts UTF-8, dicts
    their items sorted by key. Different values have different bytes; `1`, `1.0` and `True` differ.

    Raises:
        InvalidValueError: a value of another type.
    """
    match value:
        case None:
            return b"n"
        case bool():
            return b"b1" if value else b"b0"
        case int():
            return _sized(b"i", str(value).encode())
        case float():
            return b"f" + (_NAN if math.isnan(value) else struct.pack("<d", value))
        case str():
            return _sized(b"s", value.encode())
        case bytes():
            return _sized(b"y", value)
        case list() | tuple():
            return b"l%d:" % len(value) + b"".join(map(encode, value))
        case dict():
            items = sorted(((str(key), item) for key, item in value.items()), key=lambda pair: pair[0])
            return b"d%d:" % len(items) + b"".join(encode(key) + encode(item) for key, item in items)
    raise InvalidValueError("a value of the data set", "text, number, bool, bytes, list, dict or null", value)


def digest(value: Value) -> str:
    """The sha256 of `encode`, hexadecimal."""
    return hashlib.sha256(encode(value)).hexdigest()


def _sized(prefix: bytes, content: bytes) -> bytes:
    return b"%s%d:" % (prefix, len(content)) + content


@dataclass(frozen=True)
class EpisodeContent:
    """Digests of one episode.

    Attributes:
        digest: sha256 over the whole episode.
        frames: number of frames.
        features: shortened digest of the values of each feature.
        columns: shortened digest of each episode column.
    """

    episode_uuid: str
    digest: str
    frames: int
    features: dict[str, str]
    columns: dict[str, str]


@dataclass(frozen=True)
class Content:
    """Content of a data set as far as versions are compared: settings, tasks and digests of episodes."""

    fps: float
    robot_type: str | None
    features: dict[str, Any]
    tasks: list[str]
    episodes: tuple[EpisodeContent, ...]

    @property
    def hash(self) -> str:
        """The content hash, `copolicy-content-1:sha256:HEX`."""
        fields = {
            "format": FORMAT,
            "fps": float(self.fps),
            "robot_type": self.robot_type,
            "features": self.features,
            "tasks": self.tasks,
            "episodes": [episode.digest for episode in self.episodes],
        }
        return f"{FORMAT}:sha256:{digest(fields)}"
