"""Reads pickles of NumPy data without executing any function that the file names.

A pickle may call any importable function. This reader replaces the few names that NumPy arrays need by classes and
functions of its own, so that not even NumPy's reconstruction code runs on the file's bytes; it rejects other names.
"""

import io
import pickle
from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError

_NUMBERS = frozenset(f"{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8)) | {"f2", "f4", "f8", "b1"}


def load_pickle(data: bytes, path: Path | str) -> object:
    """Reads a pickle of plain Python values, NumPy numbers and NumPy arrays.

    Args:
        data: the pickle, of any protocol.
        path: its file, for errors.

    Raises:
        FileFormatError: the pickle is damaged, or holds other objects.
    """
    try:
        return _resolve(_Unpickler(io.BytesIO(data)).load())
    except (Exception, MemoryError) as error:  # damaged opcodes raise many types of errors
        raise FileFormatError(path, "a pickle of NumPy arrays and plain values", first_line(error)) from None


def first_line(error: BaseException) -> str:
    """First line of an error's message, or its type if there is none."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


class _Dtype:
    """Replaces numpy.dtype: kind and size of a number, and the byte order from the pickled state."""

    def __init__(self, code: str = "", *_):
        if code not in _NUMBERS and code not in ("O", "O8"):
            raise pickle.UnpicklingError(f"an array of data type {code!r}")
        self.code, self.order = code, "="

    def __setstate__(self, state):
        order = state[1]
        if order not in ("<", ">", "|", "="):
            raise pickle.UnpicklingError(f"byte order {order!r}")
        self.order = "=" if order == "|" else order

    @property
    def holds_objects(self) -> bool:
        return self.code.startswith("O")

    def to_numpy(self) -> np.dtype:
        return np.dtype(self.order + self.code)


class _Array:
    """Replaces numpy.ndarray: stores the pickled state until the whole pickle is read."""

    def __init__(self, *_):
        self.state: tuple | None = None

    def __setstate__(self, state):
        self.state = state

    def to_numpy(self) -> Array:
        if self.state is None:
            raise pickle.UnpicklingError("an array without content")
        _, shape, dtype, by_column, content = self.state
        order = "F" if by_column else "C"
        if dtype.holds_objects:
            values = np.empty(len(content), dtype=object)
            for index, value in enumerate(content):
                values[index] = _resolve(value)
        else:
            values = np.frombuffer(content, dtype.to_numpy())
        return values.reshape(shape, order=order).copy()


def _scalar(dtype: _Dtype, content: bytes = b""):
    if dtype.holds_objects:
        raise pickle.UnpicklingError("a number of data type object")
    return np.frombuffer(content, dtype.to_numpy())[0]


def _from_buffer(content, dtype: _Dtype, shape: tuple, order: str) -> _Array:
    array = _Array()
    array.state = (1, shape, dtype, order == "F", content)
    return array


def _latin1(text: str, encoding: str) -> bytes:
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"text in {encoding!r}")
    return text.encode("latin1")


_NAMES = {
    "_codecs.encode": _latin1,  # protocol 2 writes the bytes of an array as text
    "builtins.bytes": lambda: b"",
    "numpy.dtype": _Dtype,
    "numpy.ndarray": _Array,
    "numpy.core.multiarray._reconstruct": _Array,
    "numpy.core.multiarray.scalar": _scalar,
    "numpy.core.numeric._frombuffer": _from_buffer,
}

_ALIASES = {
    "__builtin__": "builtins",  # Python 2
    "numpy._core.multiarray": "numpy.core.multiarray",  # NumPy 2
    "numpy._core.numeric": "numpy.core.numeric",
}


class _Unpickler(pickle.Unpickler):
    def find_class(self, module_name: str, global_name: str):
        if module_name.startswith("torch"):
            raise pickle.UnpicklingError(
                f"torch tensors ({module_name}.{global_name}); save the actions as NumPy arrays first"
            )
        name = f"{_ALIASES.get(module_name, module_name)}.{global_name}"
        if name not in _NAMES:
            raise pickle.UnpicklingError(f"the name {module_name}.{global_name}, which is not allowed")
        return _NAMES[name]


def _resolve(value):
    """Replaces each `_Array` inside plain containers by its NumPy array."""
    if isinstance(value, _Array):
        return value.to_numpy()
    if isinstance(value, dict):
        return {key: _resolve(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_resolve(item) for item in value)
    if isinstance(value, _Dtype) or (isinstance(value, type) or callable(value)):
        raise pickle.UnpicklingError(f"{value!r} where a value should be")
    return value
