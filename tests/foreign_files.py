"""Files and folders that are not what a command takes: of other projects, broken, empty, or of another kind."""

import json
import os
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import mcap_variants
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import zarr

Build = Callable[[Path], Path]


class Opens:
    """What a pickle may do to whoever loads it: call a function that the file names."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return (os.mkdir, (str(self.path),))


def _hdf5(path: Path) -> Path:
    with h5py.File(path, "w") as file:
        file.create_dataset("data/demo_0/actions", data=np.zeros((5, 7)))
        file.create_dataset("data/demo_0/obs/joints", data=np.zeros((5, 7)))
    return path


def _npz(path: Path, **arrays) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez(file, **arrays)
    return path


def _bytes(path: Path, content: bytes) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def _zarr(path: Path, version: int, **arrays) -> Path:
    group = zarr.open_group(path, mode="w", zarr_format=version)  # type: ignore[arg-type]
    for name, array in arrays.items():
        group.create_array(name.replace("__", "/"), data=array)
    return path


def _store(path: Path, version: int = 2, value: float = 1.0) -> Path:
    """A store with the right names and shapes, of one value; of zeros no chunk is stored."""
    widths = {"data__obs": 18, "data__action": 4, "data__past_action": 4}
    arrays = {name: np.full((9, width), value) for name, width in widths.items()}
    return _zarr(path, version, **arrays, meta__episode_ends=np.array([9]))


def _changed(path: Path, file: str, change: Callable[[bytes], bytes]) -> Path:
    (path / file).write_bytes(change((path / file).read_bytes()))
    return path


def _zipped(folder: Path, name: str) -> Path:
    with zipfile.ZipFile(folder / name, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.suffix != ".zip":
                archive.write(file, file.relative_to(folder))
    return folder / name


def _snappy(text: bytes) -> bytes:
    return json.dumps({**json.loads(text), "compressor": {"id": "snappy"}}).encode()


def _parquet(path: Path) -> Path:
    pq.write_table(pa.table({"a": [1, 2]}), path)
    return path


def _foreign_mcap(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    mcap_variants.write(mcap_variants.camera(), path, enable_data_crcs=False)
    return path


def _folder_of(folder: Path, build: Build, name: str) -> Path:
    folder.mkdir(exist_ok=True)
    build(folder / name)
    return folder


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


def _fifo(path: Path) -> Path:
    os.mkfifo(path)
    return path


def _lerobot(folder: Path) -> Path:
    """A LeRobot data set of another task as far as its metadata."""
    info = {"codebase_version": "v3.0", "fps": 30, "features": {}, "total_episodes": 0, "total_frames": 0}
    _bytes(folder / "meta" / "info.json", json.dumps(info).encode())
    return folder


FILES: dict[str, Build] = {
    "nothing": lambda d: d / "none.mcap",
    "empty file": lambda d: _bytes(d / "a.mcap", b""),
    "text": lambda d: _bytes(d / "a.mcap", "Sitzungsprotokoll für Dienstag\n".encode()),
    "zeros": lambda d: _bytes(d / "a.mcap", bytes(4096)),
    "magic alone": lambda d: _bytes(d / "a.mcap", mcap_variants.MAGIC),
    "mcap of another project": lambda d: _foreign_mcap(d / "a.mcap"),
    "hdf5": lambda d: _hdf5(d / "a.hdf5"),
    "hdf5 named mcap": lambda d: _hdf5(d / "a.mcap"),
    "npz": lambda d: _npz(d / "a.npz", x=np.zeros(3)),
    "npy": lambda d: _bytes(d / "a.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'"),
    "pickle": lambda d: _bytes(d / "a.pkl", pickle.dumps({"a": 1})),
    "pickle that opens": lambda d: _bytes(d / "a.pkl", pickle.dumps(Opens(d / "ran"))),
    "parquet": lambda d: _parquet(d / "a.parquet"),
    "json": lambda d: _bytes(d / "a.json", b'{"a": 1}'),
    "deep json": lambda d: _bytes(d / "a.json", b"[" * 100_000),
    "zip": lambda d: _zipped(_folder_of(d / "z", lambda p: _bytes(p, b"x"), "x.txt"), "a.zip"),
    "damaged zip": lambda d: _bytes(d / "a.zarr.zip", b"PK\3\4" + bytes(60)),
    "zarr zip of another project": lambda d: _zipped(_zarr(d / "z", 2, data__img=np.zeros(3)), "a.zarr.zip"),
    "pipe": lambda d: _fifo(d / "a.mcap"),
}  # fmt: skip
"""Single files."""

FOLDERS: dict[str, Build] = {
    "empty folder": lambda d: d,
    "folder named mcap": lambda d: _folder_of(d / "a.mcap", lambda p: _bytes(p, b"x"), "x.txt"),
    "folder of text": lambda d: _folder_of(d / "a", lambda p: _bytes(p, b"x"), "x.txt"),
    "recordings of another project": lambda d: _folder_of(d / "a", _foreign_mcap, "x.mcap"),
    "text among recordings": lambda d: _folder_of(d / "a", lambda p: _bytes(p, b"x"), "x.mcap"),
    "folder in place of a recording": lambda d: _folder_of(
        d / "a", lambda p: _folder_of(p, lambda q: _bytes(q, b""), "y"), "x.mcap"
    ),
    "folder of hdf5": lambda d: _folder_of(d / "a", _hdf5, "x.hdf5"),
    "lerobot of another task": lambda d: _lerobot(d / "a"),
    "zarr v2 of another project": lambda d: _zarr(d / "a.zarr", 2, data__img=np.zeros((4, 4))),
    "zarr v3 of another project": lambda d: _zarr(d / "a.zarr", 3, data__img=np.zeros((4, 4))),
    "zarr without arrays": lambda d: _zarr(d / "a.zarr", 2, data__obs=np.zeros((9, 18))),
    "zarr of other widths": lambda d: _zarr(
        d / "a.zarr", 3, data__obs=np.zeros((9, 7)), data__action=np.zeros((9, 2)),
        data__past_action=np.zeros((9, 2)), meta__episode_ends=np.array([9]),
    ),
    "zarr of zeros": lambda d: _store(d / "a.zarr", 3, 0.0),
    "zarr of numbers alone": lambda d: _zarr(
        d / "a.zarr", 2, data__obs=np.float64(1), data__action=np.float64(1), data__past_action=np.float64(1),
        meta__episode_ends=np.float64("nan"),
    ),
    "zarr with a broken chunk": lambda d: _changed(_store(d / "a.zarr"), "data/obs/0.0", lambda b: b[:9]),
    "zarr with broken metadata": lambda d: _changed(_store(d / "a.zarr"), "data/obs/.zarray", lambda b: b[:30]),
    "zarr of an unknown compressor": lambda d: _changed(_store(d / "a.zarr"), "data/action/.zarray", _snappy),
    "npz of other keys": lambda d: _npz(d / "ep_1" / "ep_1.npz", x=np.zeros(3)).parent,
    "npz of other shapes": lambda d: _npz(
        d / "ep_1" / "ep_1.npz", states=np.zeros((0,)), actions=np.zeros(()), rewards=np.zeros((2, 2)),
        conditioning_var=np.zeros(1), table_init=np.zeros(0), table_goal=np.zeros(9), obstacles=np.zeros((2, 3)),
    ).parent,
    "npz of objects": lambda d: _npz(d / "ep_1" / "ep_1.npz", states=np.array([Opens(d / "ran")], object)).parent,
    "npz that is text": lambda d: _bytes(d / "ep_1" / "ep_1.npz", b"text").parent,
    "pickles of anything": lambda d: _bytes(d / "trajectories" / "ep_1.pkl", pickle.dumps([[1, "x", None]])).parent,
    "pickles that open": lambda d: _bytes(d / "trajectories" / "ep_1.pkl", pickle.dumps([Opens(d / "ran")])).parent,
    "empty pickles": lambda d: _bytes(d / "trajectories" / "ep_1.pkl", b"").parent,
    "folder in place of a pickle": lambda d: _folder_of(d / "trajectories", _folder, "ep_1.pkl"),
}  # fmt: skip
"""Folders."""

FOREIGN = {**FILES, **FOLDERS}
