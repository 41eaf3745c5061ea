"""One sequence of bytes for a value, whatever file it was read from."""

import hashlib
import math
import struct

from ..exceptions import InvalidValueError

Value = None | bool | int | float | str | bytes | list | tuple | dict
"""What JSON or a row of a Parquet file may hold."""

_NAN = struct.pack("<d", math.nan)


def encode(value: Value) -> bytes:
    """A value as bytes: a letter for its type, its length where that varies, its content.

    An integer is decimal digits, a float its 8 bytes (little-endian, one NaN for all), a text UTF-8, a dict its
    items in the order of their keys. No two different values share their bytes; `1`, `1.0` and `True` differ.

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


def _sized(kind: bytes, content: bytes) -> bytes:
    return b"%s%d:" % (kind, len(content)) + content
