"""Reads .npz files whose members may be object arrays, without NumPy's own unpickling."""

import io
import zipfile
from pathlib import Path

import numpy as np

from copolicy.dataset.exceptions import FileFormatError

from .restricted_pickle import load_pickle


def load_npz(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz file; object arrays hold plain values and NumPy arrays only.

    Raises:
        FileFormatError: no .npz file, or one that holds anything else.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = {name: archive.read(name) for name in archive.namelist() if name.endswith(".npy")}
        return {name.removesuffix(".npy"): _load_npy(data, path) for name, data in members.items()}
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, ValueError, NotImplementedError) as error:
        raise FileFormatError(path, "an .npz file", str(error) or repr(error)) from None


def _load_npy(data: bytes, path: Path) -> np.ndarray:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in read_header:
        raise ValueError(f"a .npy member of version {version}")
    _, _, dtype = read_header[version](stream)
    if not dtype.hasobject:
        return np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    array = load_pickle(stream.read(), path)  # the array itself is the pickle
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{type(array).__name__} where an object array should be")
    return array
