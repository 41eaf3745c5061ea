"""What diffusion_policy's ReplayBuffer and zarr 2 require of a store, each as a condition on the files.

The reader opens the store as a group, wants `data` and `meta/episode_ends`, takes whatever else lies in both for
arrays, cuts the time axis alone, copies chunks byte for byte where the compressor is the one it knows, and appends by
resizing. Zarr 2 wants every chunk complete, the last one, too.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checked_data import make_data_set, make_recordings
from numcodecs import Blosc
from numcodecs.registry import get_codec

from copolicy.convert.cli import main
from copolicy.convert.export import replay_buffer

CHUNK = 100  # rows, so that a short data set has several chunks


@pytest.fixture(scope="module")
def root(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("store")
    return make_data_set(make_recordings(folder / "raw", episodes=2), folder / "table", "--no-drift")


@pytest.fixture(params=["ours", "upstream"])
def store(root, tmp_path, request, monkeypatch, capsys) -> Path:
    monkeypatch.setattr(replay_buffer, "_CHUNK_ROWS", CHUNK)
    out = tmp_path / "table.zarr"
    arguments = ["export", str(root), "--format", "zarr", "--alignment", request.param, "--out", str(out)]
    assert main(arguments) == 0
    capsys.readouterr()
    return out


def metadata(array: Path) -> dict[str, Any]:
    return json.loads((array / ".zarray").read_text(encoding="utf-8"))


def arrays(store: Path) -> dict[str, Path]:
    return {
        f"{group}/{path.name}": path
        for group in ("data", "meta")
        for path in (store / group).iterdir()
        if path.is_dir()
    }


def read(array: Path) -> np.ndarray:
    """The array as zarr 2 puts it together: complete chunks side by side, cut to the shape."""
    about = metadata(array)
    codec: Any = get_codec(about["compressor"])
    chunks = []
    for number in range(math.ceil(about["shape"][0] / about["chunks"][0])):
        name = ".".join([str(number), *["0"] * (len(about["shape"]) - 1)])
        chunks.append(np.frombuffer(codec.decode((array / name).read_bytes()), about["dtype"]).reshape(about["chunks"]))
    return np.concatenate(chunks)[: about["shape"][0]]


def test_groups_hold_arrays_and_nothing_else(store):
    for group in (store, store / "data", store / "meta"):
        assert json.loads((group / ".zgroup").read_text(encoding="utf-8")) == {"zarr_format": 2}
    assert {path.name for path in store.iterdir()} == {".zgroup", ".zattrs", "data", "meta"}
    assert set(arrays(store)) == {"data/obs", "data/action", "data/past_action", "meta/episode_ends"}
    assert {path.name for group in ("data", "meta") for path in (store / group).iterdir() if path.is_file()} == {
        ".zgroup"
    }


def test_every_array_ends_with_the_last_episode(store):
    ends = read(arrays(store)["meta/episode_ends"])
    assert ends.dtype == np.int64
    assert ends.ndim == 1
    assert (np.diff(ends, prepend=0) > 0).all()
    for name, array in arrays(store).items():
        if name.startswith("data/"):
            values = read(array)
            assert len(values) == ends[-1]
            assert values.ndim == 2
            assert np.isfinite(values).all()


def test_arrays_are_what_the_reader_copies_byte_for_byte(store):
    for name, array in arrays(store).items():
        about = metadata(array)
        assert about["zarr_format"] == 2
        assert about["order"] == "C"
        assert about["filters"] is None
        assert np.dtype(about["dtype"]).kind in "fi"
        assert get_codec(about["compressor"]) == Blosc(cname="lz4", clevel=5, shuffle=Blosc.NOSHUFFLE), name
        assert len(about["chunks"]) == len(about["shape"])
        assert all(isinstance(length, int) and length > 0 for length in about["chunks"])
        assert about["chunks"][1:] == about["shape"][1:]  # cut along time alone


def test_chunks_are_complete_and_none_is_too_many(store):
    for name, array in arrays(store).items():
        fields = metadata(array)
        count = math.ceil(fields["shape"][0] / fields["chunks"][0])
        assert count > 1 or name == "meta/episode_ends"
        further_indices = ["0"] * (len(fields["shape"]) - 1)
        names = {".".join([str(number), *further_indices]) for number in range(count)}
        assert {path.name for path in array.iterdir()} == {".zarray", *names}
        size = int(np.prod(fields["chunks"])) * np.dtype(fields["dtype"]).itemsize
        codec: Any = get_codec(fields["compressor"])
        assert {len(codec.decode((array / chunk).read_bytes())) for chunk in names} == {size}


def test_appending_an_episode_by_resizing_keeps_the_other_rows(store):
    """What `add_episode` does: a longer shape, and rows written behind the last one."""
    array = arrays(store)["data/action"]
    before, about = read(array), metadata(array)
    codec: Any = get_codec(about["compressor"])
    free = -len(before) % CHUNK
    assert free > 0
    added = np.full((free, 4), 0.25)
    last = array / f"{len(before) // CHUNK}.0"
    chunk = np.frombuffer(codec.decode(last.read_bytes()), about["dtype"]).reshape(CHUNK, 4).copy()
    assert not chunk[CHUNK - free :].any()  # the fill value that the metadata promise
    assert about["fill_value"] == 0
    chunk[CHUNK - free :] = added
    last.write_bytes(codec.encode(chunk))
    about["shape"][0] += free
    (array / ".zarray").write_text(json.dumps(about), encoding="utf-8")
    np.testing.assert_array_equal(read(array), np.vstack((before, added)))
