"""Reads the Parquet files of a data set as if each table were one file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import FileFormatError, MissingExtraError
from ..files import visible_files

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None


def files_under(root: Path, folder: str) -> list[Path]:
    """The Parquet files below a folder of a data set, in the order of their paths.

    Raises:
        FileFormatError: there is none.
    """
    files = visible_files(root / folder, "*.parquet")
    if not files:
        raise FileFormatError(root, f"at least one Parquet file under {folder}", "none")
    return files


def column_names(path: Path) -> list[str]:
    """The columns of a file.

    Raises:
        FileFormatError: no complete Parquet file.
    """
    try:
        return pq.read_schema(path).names
    except (pa.ArrowInvalid, OSError) as error:
        raise _damaged(path, error) from None


def read_rows(path: Path, columns: Sequence[str]) -> list[dict[str, Any]]:
    """The rows of a file as dicts.

    Raises:
        FileFormatError: no complete Parquet file.
    """
    try:
        return pq.read_table(path, columns=list(columns)).to_pylist()
    except (pa.ArrowInvalid, OSError) as error:
        raise _damaged(path, error) from None


def read_values(files: Sequence[Path], column: str) -> list[Any]:
    """A column of texts or pictures over all files."""
    return [row[column] for path in files for row in read_rows(path, [column])]


def read_numbers(files: Sequence[Path], column: str, dtype: str, width: int) -> np.ndarray:
    """A column of numbers over all files, `(rows, width)`, little-endian.

    Raises:
        FileFormatError: a file is damaged, lacks a value, or holds rows of another width.
    """
    kind = np.dtype(dtype).newbyteorder("<")
    return np.concatenate([_numbers(path, column, width).astype(kind) for path in files])


def _numbers(path: Path, column: str, width: int) -> np.ndarray:
    try:
        values = pq.read_table(path, columns=[column]).column(column).combine_chunks()
    except (pa.ArrowInvalid, OSError) as error:
        raise _damaged(path, error) from None
    rows = len(values)
    nulls = values.null_count
    while isinstance(values, (pa.ListArray, pa.LargeListArray, pa.FixedSizeListArray)):
        values = values.flatten()
        nulls += values.null_count
    if nulls:
        raise FileFormatError(path, f"a value in every row of {column!r}", f"{nulls} without")
    if len(values) != rows * width:
        raise FileFormatError(path, f"{width} numbers a row in {column!r}", f"{len(values)} in {rows} rows")
    return values.to_numpy(zero_copy_only=False).reshape(rows, width)


def _damaged(path: Path, error: Exception) -> FileFormatError:
    return FileFormatError(path, "a complete Parquet file", str(error).splitlines()[0])
