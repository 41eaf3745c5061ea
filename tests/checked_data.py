"""Data sets for the tests of checks and exclusions: made by the commands, then changed cell by cell."""

import contextlib
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from made_once import simulated

from copolicy.convert.cli import main as convert

EPISODES = Path("meta/episodes/chunk-000/file-000.parquet")
FRAMES = Path("data/chunk-000/file-000.parquet")


def make_recordings(folder: Path, episodes: int = 6, seed: int = 1) -> Path:
    """Recordings of scripted pairs."""
    return simulated(folder, episodes, seed)


def make_data_set(recordings: Path, root: Path, *flags: str) -> Path:
    """The recordings as a data set at 10 Hz."""
    arguments = ["mcap", str(recordings), "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0"]
    with contextlib.redirect_stdout(io.StringIO()):
        assert convert([*arguments, *flags]) == 0
    return root


def set_columns(root: Path, **columns: Callable[[list], list] | list) -> None:
    """Replaces columns of meta/episodes, by lists or by functions of the present values."""
    table = pq.ParquetFile(root / EPISODES).read()
    for name, values in columns.items():
        place = table.column_names.index(name)
        given: Any = values(table.column(name).to_pylist()) if callable(values) else values
        table = table.set_column(place, name, pa.array(given, table.schema.field(name).type))
    pq.write_table(table, root / EPISODES)


def set_frames(root: Path, name: str, change: Callable[[np.ndarray], np.ndarray]) -> None:
    """Replaces a column of the frames by a function of the present values `(N, n)` or `(N,)`."""
    table = pq.ParquetFile(root / FRAMES).read()
    field = table.schema.field(name)
    values = np.array(table.column(name).to_pylist())
    changed = change(values.copy())
    array = pa.array(changed.tolist(), field.type)
    pq.write_table(table.set_column(table.column_names.index(name), field, array), root / FRAMES)


def contents(root: Path) -> dict[str, bytes]:
    """Every file of a folder."""
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}
