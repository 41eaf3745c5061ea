import io
import pickle
import pickletools
import zipfile

import numpy as np
import pytest

from copolicy.convert.upstream.restricted_npz import load_npz
from copolicy.convert.upstream.restricted_pickle import load_pickle
from copolicy.dataset.exceptions import FileFormatError

VALUES = [
    np.float64(0.1),
    np.int64(-3),
    np.bool_(True),
    True,
    7,
    "text",
    None,
    [np.float64(2.5), np.float64(-0.0)],
    np.arange(6, dtype="<i4").reshape(2, 3),
    np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    np.array([1.5, 2.5], dtype=">f8"),
    np.zeros((0, 2)),
    {"table": {"x": 240.0, "list": [0, 2]}},
    np.array([{"goal": np.array([960.0, 420.0])}, None], dtype=object),
]


class Calls:
    """Unpickling an instance calls a function."""

    def __init__(self, function, *arguments):
        self.call = function, arguments

    def __reduce__(self):
        return self.call


def assert_same(loaded, expected):
    if isinstance(expected, np.ndarray):
        assert isinstance(loaded, np.ndarray)
        assert loaded.dtype == expected.dtype
        assert loaded.shape == expected.shape
        for loaded_item, expected_item in zip(loaded.ravel(), expected.ravel(), strict=True):
            assert_same(loaded_item, expected_item)
    elif isinstance(expected, (list, tuple)):
        assert type(loaded) is type(expected)
        for loaded_item, expected_item in zip(loaded, expected, strict=True):
            assert_same(loaded_item, expected_item)
    elif isinstance(expected, dict):
        assert list(loaded) == list(expected)
        assert_same(list(loaded.values()), list(expected.values()))
    else:
        assert type(loaded) is type(expected)
        assert loaded == expected


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_numbers_and_arrays_come_back_as_they_were(protocol):
    assert_same(load_pickle(pickle.dumps(VALUES, protocol), "f.pkl"), VALUES)


def test_files_of_the_original_read_as_numpy_reads_them(upstream):
    for path in sorted((upstream / "examples_scripted" / "raw" / "trajectories").glob("*.pkl")):
        data = path.read_bytes()
        assert_same(load_pickle(data, path), pickle.loads(data))


@pytest.mark.parametrize("protocol", [0, 2, 4])
def test_nothing_that_the_file_names_is_run(protocol, tmp_path):
    trace = tmp_path / "trace"
    data = pickle.dumps([Calls(open, str(trace), "w")], protocol)
    with pytest.raises(FileFormatError) as error:
        load_pickle(data, "f.pkl")
    assert "f.pkl: expected a pickle of NumPy arrays and plain values, found the name " in str(error.value)
    assert str(error.value).endswith("open, which is not allowed")
    assert not trace.exists()


@pytest.mark.parametrize("name", ["eval", "getattr", "__import__"])
def test_builtins_are_refused(name):
    data = f"cbuiltins\n{name}\n.".encode()
    with pytest.raises(FileFormatError, match=f"the name builtins.{name}, which is not allowed"):
        load_pickle(data, "f.pkl")


def test_another_function_of_numpy_is_refused():
    data = pickle.dumps(Calls(np.load, "other.npy"))
    with pytest.raises(FileFormatError, match="load, which is not allowed"):
        load_pickle(data, "f.pkl")


def test_a_torch_tensor_is_refused_by_name():
    data = b"ctorch._utils\n_rebuild_tensor_v2\n."
    with pytest.raises(FileFormatError) as error:
        load_pickle(data, "ep_1.pkl")
    assert str(error.value) == (
        "ep_1.pkl: expected a pickle of NumPy arrays and plain values, found torch tensors "
        "(torch._utils._rebuild_tensor_v2); save the actions as NumPy arrays first"
    )


def test_a_bare_reference_to_an_allowed_name_is_no_value():
    with pytest.raises(FileFormatError, match="where a value should be"):
        load_pickle(b"cnumpy\ndtype\n.", "f.pkl")


def test_an_array_whose_content_does_not_fill_it_is_refused():
    data = pickle.dumps(np.arange(4.0), 4)
    positions = [
        position for op, argument, position in pickletools.genops(data) if op.name == "BININT1" and argument == 4
    ]
    shape = positions[0] or 0
    damaged = data[: shape + 1] + b"\x09" + data[shape + 2 :]
    with pytest.raises(FileFormatError, match="cannot reshape"):
        load_pickle(damaged, "f.pkl")


def test_structured_and_long_types_are_refused():
    with pytest.raises(FileFormatError, match="an array of data type 'V8'"):
        load_pickle(pickle.dumps(np.zeros(2, dtype=[("a", "f8")]), 4), "f.pkl")


def test_damage_anywhere_is_one_error(upstream):
    path = upstream / "examples_scripted" / "raw" / "trajectories" / "ep_11.pkl"
    data = path.read_bytes()
    for end in (0, 1, 100, len(data) // 2, len(data) - 1):
        with pytest.raises(FileFormatError, match="expected a pickle of NumPy arrays and plain values, found"):
            load_pickle(data[:end], path)
    rng = np.random.default_rng(0)
    read = 0
    for position in rng.integers(0, 3000, 300):
        flipped = bytearray(data)
        flipped[position] ^= 1 << rng.integers(8)
        try:
            load_pickle(bytes(flipped), path)
            read += 1
        except FileFormatError:
            pass
    assert 0 < read < 300  # a flip in a number is still a number


def test_npz_reads_plain_and_object_members(tmp_path):
    path = tmp_path / "map.npz"
    np.savez(path, plain=np.arange(3), table=np.array({"x": 1.0}, dtype=object), name="ep_1")
    fields = load_npz(path)
    assert fields["plain"].tolist() == [0, 1, 2]
    assert fields["table"].item() == {"x": 1.0}
    assert str(fields["name"]) == "ep_1"


def test_npz_runs_nothing_either(tmp_path):
    trace, path = tmp_path / "trace", tmp_path / "map.npz"
    np.savez(path, table=np.array(Calls(open, str(trace), "w"), dtype=object))
    with pytest.raises(FileFormatError, match="open, which is not allowed"):
        load_npz(path)
    assert not trace.exists()


def test_npz_that_is_none(tmp_path):
    path = tmp_path / "map.npz"
    path.write_bytes(b"no archive")
    with pytest.raises(FileFormatError, match=r"map.npz: expected an .npz file, found a text file"):
        load_npz(path)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("table.npy", b"\x93NUMPY\x09\x00")
    path.write_bytes(stream.getvalue())
    with pytest.raises(FileFormatError, match=r"expected an .npz file, found"):
        load_npz(path)
