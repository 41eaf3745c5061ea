"""Reads .npz files with object arrays without NumPy's unpickling."""

import io
import math
import zipfile
from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.file_kinds import describe_path

from .restricted_pickle import first_line, load_pickle

_LARGEST = 256 << 20  # bytes of all arrays of a file; an episode needs less than one hundredth of it
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def load_npz(path: Path) -> dict[str, Array]:
    """Reads the arrays of an .npz file; object arrays may hold plain Python values and NumPy arrays only.

    Raises:
        FileFormatError: no .npz file, a damaged one, one that unpacks to more than 256 MiB, or one with other objects.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            size = sum(member.file_size for member in members)
            if size > _LARGEST:
                raise FileFormatError(path, f"arrays of at most {_LARGEST >> 20} MiB", f"{size >> 20} MiB")
            contents = {member.filename: archive.read(member) for member in members}
        return {name.removesuffix(".npy"): _load_npy(data, path) for name, data in contents.items()}
    except FileFormatError:
        raise
    except OSError as error:
        raise FileFormatError(path, "a readable .npz file", error.strerror or str(error)) from None
    except (Exception, MemoryError) as error:  # zipfile, zlib and the header's parser raise many types
        file_kind = describe_path(path)
        description = (
            f"a damaged one ({first_line(error)})" if "NumPy" in file_kind or "zip" in file_kind else file_kind
        )
        raise FileFormatError(path, "an .npz file", description) from None


def _load_npy(data: bytes, path: Path) -> Array:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version not in _HEADERS:
        raise ValueError(f"a .npy member of version {version}")
    shape, _, dtype = _HEADERS[version](stream)
    if not dtype.hasobject:
        # NumPy allocates the size in the header before it notices missing data.
        if math.prod(shape) * dtype.itemsize > len(data):
            raise ValueError(f"an array of shape {shape} in {len(data)} bytes")
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    array = load_pickle(stream.read(), path)  # the whole array is one pickle
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{type(array).__name__} where an object array should be")
    return array
