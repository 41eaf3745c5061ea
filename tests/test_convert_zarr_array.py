import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from numcodecs.registry import get_codec

from copolicy.convert.zarr_array import read_zarr_array
from copolicy.dataset.exceptions import FileFormatError

LZ4 = {"id": "blosc", "cname": "lz4", "clevel": 5, "shuffle": 1, "blocksize": 0}


def write_zarr(folder: Path, array: np.ndarray, chunks, compressor=None, order="C", separator=".", skip=(), **changes):
    """A Zarr v2 array, by the text of the specification."""
    folder.mkdir(parents=True)
    metadata = {
        "zarr_format": 2,
        "shape": array.shape,
        "chunks": chunks,
        "dtype": array.dtype.str,
        "compressor": compressor,
        "fill_value": 0,
        "filters": None,
        "order": order,
        "dimension_separator": separator,
    }
    (folder / ".zarray").write_text(json.dumps({**metadata, **changes}), encoding="utf-8")
    for place in itertools.product(*(range(math.ceil(s / c)) for s, c in zip(array.shape, chunks, strict=True))):
        if place in skip:
            continue
        chunk = np.zeros(chunks, array.dtype)
        part = array[tuple(slice(i * c, (i + 1) * c) for i, c in zip(place, chunks, strict=True))]
        chunk[tuple(map(slice, part.shape))] = part
        data = chunk.tobytes(order=order)
        file = folder / separator.join(map(str, place))
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(bytes(get_codec(dict(compressor)).encode(data)) if compressor else data)  # pyright: ignore


@pytest.mark.parametrize("compressor", [None, LZ4, {"id": "zlib", "level": 1}, {"id": "zstd", "level": 1}])
@pytest.mark.parametrize(
    ("chunks", "order", "separator"), [((7, 4), "C", "."), ((3, 2), "F", "/"), ((10, 10), "C", ".")]
)
def test_any_chunking_reads_back(tmp_path, compressor, chunks, order, separator):
    array = np.random.default_rng(0).normal(size=(7, 4))
    write_zarr(tmp_path / "a", array, chunks, compressor, order, separator)
    assert np.array_equal(read_zarr_array(tmp_path / "a"), array)


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i8", "|u1", "|b1"])
def test_number_types(tmp_path, dtype):
    array = np.arange(5).astype(dtype)
    write_zarr(tmp_path / "a", array, (2,))
    found = read_zarr_array(tmp_path / "a")
    assert found.dtype == array.dtype
    assert np.array_equal(found, array)


def test_a_chunk_that_is_not_stored_is_the_fill_value(tmp_path):
    array = np.arange(1.0, 7.0)
    write_zarr(tmp_path / "a", array, (2,), skip=[(1,)], fill_value="NaN")
    assert np.array_equal(read_zarr_array(tmp_path / "a"), [1, 2, math.nan, math.nan, 5, 6], equal_nan=True)


def test_the_store_of_the_original(upstream):
    store = upstream / "examples_scripted" / "table_10Hz.zarr"
    assert read_zarr_array(store / "data" / "obs").shape == (1933, 18)
    assert read_zarr_array(store / "meta" / "episode_ends").tolist()[-1] == 1933


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"zarr_format": 3}, "expected a Zarr v2 array of numbers, found zarr_format 3"),
        ({"dtype": "|O"}, "found data type '|O'"),
        ({"filters": [{"id": "pickle"}]}, "found filters [{'id': 'pickle'}]"),
        ({"compressor": {"id": "pickle"}}, "compressor among blosc, bz2, gzip, lz4, lzma, zlib, zstd, found 'pickle'"),
        ({"shape": [4, 2]}, "found shape (4, 2) in chunks (2,)"),
        ({"order": "K"}, "found order 'K'"),
    ],
)  # fmt: skip
def test_what_it_leaves_out_is_refused(tmp_path, changes, found):
    write_zarr(tmp_path / "a", np.arange(4.0), (2,), **changes)
    with pytest.raises(FileFormatError) as error:
        read_zarr_array(tmp_path / "a")
    assert found in str(error.value)


def test_damage(tmp_path):
    with pytest.raises(FileFormatError, match=r"\.zarray: expected the metadata of a Zarr v2 array, found no file"):
        read_zarr_array(tmp_path)
    write_zarr(tmp_path / "a", np.arange(100.0), (100,), LZ4)
    chunk = tmp_path / "a" / "0"
    chunk.write_bytes(chunk.read_bytes()[:20])
    with pytest.raises(FileFormatError, match="0: expected a chunk of 800 bytes, found"):
        read_zarr_array(tmp_path / "a")
    write_zarr(tmp_path / "b", np.arange(4.0), (4,))
    (tmp_path / "b" / "0").write_bytes(b"1234567")
    with pytest.raises(FileFormatError, match="0: expected a chunk of 32 bytes, found"):
        read_zarr_array(tmp_path / "b")
