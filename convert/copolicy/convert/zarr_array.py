"""Reads arrays of a Zarr v2 store: as much of the format as stores of numbers use, with numcodecs for the chunks.

Format: https://zarr-specs.readthedocs.io/en/latest/v2/v2.0.html
"""

import itertools
import json
import math
from pathlib import Path

import numpy as np

from copolicy.dataset.exceptions import FileFormatError, MissingExtraError

_CODECS = ("blosc", "bz2", "gzip", "lz4", "lzma", "zlib", "zstd")  # numcodecs also has one that unpickles
_FILLS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


def read_zarr_array(folder: Path) -> np.ndarray:
    """The array in a folder with `.zarray`, of any chunking.

    Raises:
        FileFormatError: the metadata or a chunk is not what the format says, or uses what this reader leaves out:
            filters, object and structured data types, codecs beyond the numeric ones.
        MissingExtraError: numcodecs is not installed.
    """
    metadata = _metadata(folder / ".zarray")
    shape, chunks, dtype = metadata["shape"], metadata["chunks"], metadata["dtype"]
    codec = _codec(metadata["compressor"], folder)
    array = np.full(shape, metadata["fill_value"], dtype)
    grid = [range(math.ceil(size / chunk)) for size, chunk in zip(shape, chunks, strict=True)]
    for position in itertools.product(*grid):
        file = folder / (metadata["separator"].join(map(str, position)) or "0")
        if not file.is_file():  # a chunk that holds the fill value only need not be stored
            continue
        chunk = _chunk(file, codec, dtype, chunks, metadata["order"])
        place = tuple(slice(i * c, min((i + 1) * c, s)) for i, c, s in zip(position, chunks, shape, strict=True))
        array[place] = chunk[tuple(slice(part.stop - part.start) for part in place)]
    return array


def _metadata(path: Path) -> dict:
    try:
        fields = json.loads(path.read_text(encoding="utf-8"))
        if fields["zarr_format"] != 2:
            raise ValueError(f"zarr_format {fields['zarr_format']!r}")
        if fields.get("filters"):
            raise ValueError(f"filters {fields['filters']!r}")
        dtype = np.dtype(fields["dtype"])
        if dtype.kind not in "biuf":
            raise ValueError(f"data type {fields['dtype']!r}")
        shape, chunks = tuple(map(int, fields["shape"])), tuple(map(int, fields["chunks"]))
        if len(shape) != len(chunks) or min((*chunks, 1)) < 1 or min((*shape, 0)) < 0:
            raise ValueError(f"shape {shape} in chunks {chunks}")
        if fields["order"] not in ("C", "F"):
            raise ValueError(f"order {fields['order']!r}")
        fill = fields["fill_value"]
        return {
            "shape": shape,
            "chunks": chunks,
            "dtype": dtype,
            "compressor": fields["compressor"],
            "fill_value": 0 if fill is None else _FILLS.get(fill, fill),
            "order": fields["order"],
            "separator": fields.get("dimension_separator", "."),
        }
    except FileNotFoundError:
        raise FileFormatError(path, "the metadata of a Zarr v2 array", "no file") from None
    except (ValueError, TypeError, KeyError) as error:
        raise FileFormatError(path, "a Zarr v2 array of numbers", str(error)) from None


def _codec(settings: dict | None, folder: Path):
    if settings is None:
        return None
    if settings.get("id") not in _CODECS:
        raise FileFormatError(folder / ".zarray", f"a compressor among {', '.join(_CODECS)}", repr(settings.get("id")))
    try:
        from numcodecs.registry import get_codec
    except ImportError:
        raise MissingExtraError("numcodecs") from None
    return get_codec(dict(settings))


def _chunk(file: Path, codec, dtype: np.dtype, chunks: tuple[int, ...], order) -> np.ndarray:
    stored = file.read_bytes()
    try:
        data = stored if codec is None else codec.decode(stored)
        return np.frombuffer(data, dtype).reshape(chunks, order=order)
    except (ValueError, RuntimeError, OSError, EOFError) as error:
        size = dtype.itemsize * math.prod(chunks)
        raise FileFormatError(file, f"a chunk of {size} bytes", str(error)) from None
