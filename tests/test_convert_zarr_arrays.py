"""Arrays of a Zarr store: version 2 by the text of its specification, version 3 and zip files by the zarr library."""

import itertools
import json
import math
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import zarr
from numcodecs.registry import get_codec
from zarr.codecs import BloscCodec, GzipCodec

from copolicy.convert.cli import main
from copolicy.convert.upstream import zarr_arrays
from copolicy.convert.upstream.build_episode import UpstreamOptions
from copolicy.convert.upstream.conversion import open_upstream
from copolicy.convert.upstream.zarr_arrays import ZarrArrays
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
    for index in itertools.product(*(range(math.ceil(s / c)) for s, c in zip(array.shape, chunks, strict=True))):
        if index in skip:
            continue
        chunk = np.zeros(chunks, array.dtype)
        block = array[tuple(slice(i * c, (i + 1) * c) for i, c in zip(index, chunks, strict=True))]
        chunk[tuple(map(slice, block.shape))] = block
        data = chunk.tobytes(order=order)
        file = folder / separator.join(map(str, index))
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(bytes(get_codec(dict(compressor)).encode(data)) if compressor else data)  # pyright: ignore


def read(folder: Path, array: str = "a") -> np.ndarray:
    return ZarrArrays(folder, array).read(array)


def refusal(folder: Path, array: str = "a") -> str:
    with pytest.raises(FileFormatError) as error:
        read(folder, array)
    message = str(error.value)
    assert message.startswith(str(folder))
    assert "\n" not in message
    return message


@pytest.mark.parametrize("compressor", [None, LZ4, {"id": "zlib", "level": 1}, {"id": "zstd", "level": 1}])
@pytest.mark.parametrize(
    ("chunks", "order", "separator"), [((7, 4), "C", "."), ((3, 2), "F", "/"), ((10, 10), "C", ".")]
)
def test_any_chunking_reads_back(tmp_path, compressor, chunks, order, separator):
    array = np.random.default_rng(0).normal(size=(7, 4))
    write_zarr(tmp_path / "a", array, chunks, compressor, order, separator)
    assert np.array_equal(read(tmp_path), array)


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<i8", "|u1", "|b1"])
def test_number_types(tmp_path, dtype):
    array = np.arange(5).astype(dtype)
    write_zarr(tmp_path / "a", array, (2,))
    assert np.array_equal(read(tmp_path), array)


def test_a_chunk_that_is_not_stored_is_the_fill_value(tmp_path):
    array = np.arange(1.0, 7.0)
    write_zarr(tmp_path / "a", array, (2,), skip=[(1,)], fill_value="NaN")
    assert np.array_equal(read(tmp_path), [1, 2, math.nan, math.nan, 5, 6], equal_nan=True)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"shards": (4, 4)},
        {"compressors": BloscCodec(cname="lz4")},
        {"compressors": GzipCodec()},
    ],
)
def test_version_3(tmp_path, options):
    array = np.random.default_rng(0).normal(size=(7, 4))
    zarr.create_array(tmp_path / "store", name="a", data=array, chunks=(2, 4), zarr_format=3, **options)
    assert np.array_equal(read(tmp_path / "store"), array)


@pytest.fixture(params=["v2", "v3", "v2.zip", "v3.zip", "nested.zip"])
def store(request, upstream, tmp_path):
    """The store of the original program in every form, and what it holds."""
    folder = upstream / "examples_scripted" / "table_10Hz.zarr"
    names = ("data/obs", "data/action", "data/past_action", "meta/episode_ends")
    arrays = {name: read(folder, name) for name in names}
    path = tmp_path / "table.zarr"
    group = zarr.open_group(path, mode="w", zarr_format=3 if "3" in request.param else 2)
    for name, array in arrays.items():
        group.create_array(name, data=array, chunks=(100, *array.shape[1:]))
    if not request.param.endswith("zip"):
        return path, arrays
    below = Path("replay_buffer.zarr") if request.param == "nested.zip" else Path()
    with zipfile.ZipFile(f"{path}.zip", "w") as archive:
        for file in sorted(path.rglob("*")):
            archive.write(file, below / file.relative_to(path))
    return Path(f"{path}.zip"), arrays


def test_the_store_of_the_original_in_every_form(store, upstream):
    path, arrays = store
    for name, array in arrays.items():
        assert np.array_equal(ZarrArrays(path, "data/obs").read(name), array)
    original = open_upstream(upstream / "examples_scripted" / "table_10Hz.zarr")
    (_, read_theirs), (_, read_ours) = original.readers[0], open_upstream(path).readers[0]
    theirs, ours = read_theirs(UpstreamOptions()), read_ours(UpstreamOptions())
    assert np.array_equal(ours.states, theirs.states)
    assert np.array_equal(ours.actions, theirs.actions)
    assert ours.meta.episode_uuid == theirs.meta.episode_uuid
    if path.suffix == ".zip":
        (path.parent / "archive").mkdir()
        moved = path.rename(path.parent / "archive" / path.name)
        assert len(open_upstream(moved.parent).readers) == len(original.readers) == 11


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"zarr_format": 3}, "expected the metadata of an array of numbers, found zarr_format 3"),
        ({"dtype": "|O"}, "found data type '|O'"),
        ({"filters": [{"id": "pickle"}]}, "found filters [{'id': 'pickle'}]"),
        ({"compressor": {"id": "pickle"}}, "compressor 'pickle', none of blosc, bz2, gzip, lz4, lzma, zlib, zstd"),
        ({"compressor": {"id": "snappy"}}, "found compressor 'snappy', none of"),
        ({"shape": [4, 2]}, "found shape [4, 2] in chunks [2]"),
        ({"shape": [10**15]}, "more than 1024 MiB or 1048576 chunks"),
        ({"chunks": [10**12]}, "more than 1024 MiB or 1048576 chunks"),
        ({"shape": [10**7], "chunks": [1]}, "more than 1024 MiB or 1048576 chunks"),
        ({"shape": [-1]}, "found shape [-1] in chunks [2]"),
        ({"shape": "many"}, "found shape many in chunks [2]"),
        ({"order": "K"}, "expected an array with intact chunks, found"),
    ],
)  # fmt: skip
def test_what_it_leaves_out_is_refused(tmp_path, changes, found):
    write_zarr(tmp_path / "a", np.arange(4.0), (2,))
    file = tmp_path / "a" / ".zarray"
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **changes}), encoding="utf-8")
    assert found in refusal(tmp_path)


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({"node_type": "group"}, "found zarr_format 3, node_type 'group'"),
        ({"data_type": "string"}, "data type"),
        ({"data_type": {"name": "numpy.datetime64"}}, "data type"),
        ({"codecs": [{"name": "numcodecs.pickle"}]}, "found codec 'numcodecs.pickle', none of blosc"),
        ({"codecs": [{"name": "sharding_indexed", "configuration": {"codecs": ["vlen-bytes"]}}]}, "'vlen-bytes'"),
        ({"chunk_grid": {"name": "irregular"}}, "found chunk_grid 'irregular'"),
        ({"shape": [10**12]}, "more than 1024 MiB"),
    ],
)
def test_what_it_leaves_out_of_version_3_is_refused(tmp_path, changes, found):
    zarr.create_array(tmp_path, name="a", data=np.arange(4.0), zarr_format=3)
    file = tmp_path / "a" / "zarr.json"
    file.write_text(json.dumps({**json.loads(file.read_text(encoding="utf-8")), **changes}), encoding="utf-8")
    assert found in refusal(tmp_path)


def test_nothing_is_unpickled(tmp_path):
    """Neither by a filter nor by a compressor that calls what the file names."""
    ran = tmp_path / "ran"

    class Call:
        def __reduce__(self):
            return (Path.touch, (ran,))

    for number, name in enumerate(("compressor", "filters")):
        folder = tmp_path / str(number)
        write_zarr(folder / "a", np.arange(4.0), (4,))
        file = folder / "a" / ".zarray"
        codec = {"id": "pickle"}
        metadata = {**json.loads(file.read_text(encoding="utf-8")), name: [codec] if name == "filters" else codec}
        file.write_text(json.dumps(metadata), encoding="utf-8")
        (folder / "a" / "0").write_bytes(pickle.dumps(Call()))
        refusal(folder)
    assert not ran.exists()


def test_damage(tmp_path):
    assert "a: expected a Zarr array (.zarray or zarr.json), found none" in refusal(tmp_path)
    write_zarr(tmp_path / "a", np.arange(100.0), (100,), LZ4)
    chunk = tmp_path / "a" / "0"
    chunk.write_bytes(chunk.read_bytes()[:20])
    assert "a: expected an array with intact chunks, found" in refusal(tmp_path)
    write_zarr(tmp_path / "b", np.arange(4.0), (4,))
    (tmp_path / "b" / "0").write_bytes(b"1234567")
    assert "b: expected an array with intact chunks, found" in refusal(tmp_path, "b")
    (tmp_path / "b" / ".zarray").write_text("[" * 10**5, encoding="utf-8")
    assert "b/.zarray: expected the metadata of an array of numbers, found" in refusal(tmp_path, "b")


def zipped(path: Path, members: dict[str, bytes], **options) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


METADATA = json.dumps(
    {"zarr_format": 2, "shape": [4], "chunks": [4], "dtype": "<f8", "compressor": None, "fill_value": 0, "order": "C",
     "filters": None}
).encode()  # fmt: skip


@pytest.mark.parametrize(
    ("members", "found"),
    [
        ({"notes.txt": b"x"}, "expected one zipped Zarr store with an array a, found a zip archive without it"),
        ({"a/.zarray": METADATA, "x/a/.zarray": METADATA}, "found 2 of them"),
        ({"a/.zarray": METADATA, "../../cron": b"x"}, "expected names inside of the archive, found '../../cron'"),
        ({"a/.zarray": METADATA, "/etc/cron": b"x"}, "expected names inside of the archive, found '/etc/cron'"),
        ({"a/.zarray": METADATA, "C:/cron": b"x"}, "expected names inside of the archive, found 'C:/cron'"),
        ({"a/.zarray": METADATA, "a/0": b"1234567"}, "expected an array with intact chunks, found"),
    ],
)  # fmt: skip
def test_zip_files_that_are_refused(tmp_path, members, found):
    assert found in refusal(zipped(tmp_path / "store.zarr.zip", members))


def test_a_zip_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(zarr_arrays, "_LARGEST", 3 << 20)
    members = {"a/.zarray": METADATA, **{f"a/{number}": bytes(1 << 20) for number in range(4)}}
    path = zipped(tmp_path / "bomb.zarr.zip", members)
    assert path.stat().st_size < 10_000
    assert "expected an archive of at most 3 MiB unpacked, found 4 MiB" in refusal(path)


def test_damaged_zip_files(tmp_path):
    path = zipped(tmp_path / "store.zarr.zip", {"a/.zarray": METADATA, "a/0": np.arange(4.0).tobytes()})
    assert np.array_equal(read(path), np.arange(4.0))
    content = path.read_bytes()
    for damaged in (content[:-30], content[: len(content) // 2], b"PK\3\4" + bytes(40), b""):
        path.write_bytes(damaged)
        refusal(path)
        assert main(["upstream", str(path), "--out", str(tmp_path / "set"), "--repo-id", "lab/x"]) == 2
    flipped = bytearray(content)
    flipped[40] ^= 0xFF  # within the first member
    path.write_bytes(flipped)
    refusal(path)
