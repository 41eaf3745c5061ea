"""The Parquet tables of a LeRobot data set: columns as arrays, with their types checked."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..exceptions import FileFormatError, MissingExtraError

try:
    import pyarrow as pa
    import pyarrow.compute as pc
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

DAMAGED = (pa.ArrowException, OSError, ValueError)
"""What pyarrow raises where a file is no complete Parquet file."""
_LISTS = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
_NAMES = {"str": "texts", "int": "whole numbers", "float": "numbers", "bool": "true or false"}
_DTYPES: dict[str, Any] = {"int": np.int64, "float": np.float64, "bool": bool}


class ColumnError(ValueError):
    """A column that does not hold what it should.

    Attributes:
        expected: what it should hold.
        found: what it holds.
        rows: the rows concerned, where it is not the whole column.
    """

    def __init__(self, expected: str, found: str, rows: Sequence[int] = ()):
        super().__init__(f"expected {expected}, found {found}")
        self.expected, self.found, self.rows = expected, found, tuple(rows)


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """The table in one file.

    Args:
        columns: only these, all of which must be there.

    Raises:
        FileFormatError: no complete Parquet file, or one without these columns.
    """
    try:
        # One file, not a data set of pyarrow's, which would take chunk-000 for a partition.
        with pq.ParquetFile(path) as file:
            there = file.schema_arrow.names
            missing = [name for name in columns or () if name not in there]
            if missing:
                raise FileFormatError(path, "the columns of copolicy", f"none named {', '.join(missing)}")
            if len(set(there)) < len(there):
                raise FileFormatError(path, "each column once", f"{_repeated(there)} twice")
            return file.read(columns=None if columns is None else list(columns))
    except DAMAGED as error:
        raise damaged(path, error) from None


def column_types(path: Path) -> dict[str, pa.DataType]:
    """Name and type of the columns of a file.

    Raises:
        FileFormatError: no complete Parquet file.
    """
    try:
        with pq.ParquetFile(path) as file:
            return {field.name: field.type for field in file.schema_arrow}
    except DAMAGED as error:
        raise damaged(path, error) from None


def row_count(path: Path) -> int:
    """Rows of a file.

    Raises:
        FileFormatError: no complete Parquet file.
    """
    try:
        with pq.ParquetFile(path) as file:
            return file.metadata.num_rows
    except DAMAGED as error:
        raise damaged(path, error) from None


def damaged(path: Path, error: Exception) -> FileFormatError:
    """The error for a file that pyarrow refuses."""
    found = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
    return FileFormatError(path, "a complete Parquet file", found)


def is_list(kind: pa.DataType) -> bool:
    """Whether a column holds lists, of one length or of several."""
    return any(test(kind) for test in _LISTS)


def scalars(column: pa.ChunkedArray, kind: str, unknown: Any = None) -> np.ndarray:
    """`(N,)` a column of single values.

    Args:
        kind: `str`, `int`, `float` or `bool`, as `EPISODE_COLUMNS` has it; whole numbers may be stored as floats.
        unknown: stands for an empty entry; None where there may be none.

    Raises:
        ColumnError: values of another type, or an empty entry.
    """
    values = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if pa.types.is_dictionary(values.type):
        values = values.dictionary_decode()
    expected = f"{_NAMES[kind]} in every row" if unknown is None else _NAMES[kind]
    if not (_fits(values.type, kind) or (pa.types.is_null(values.type) and unknown is not None)):
        raise ColumnError(expected, str(values.type))
    empty = np.flatnonzero(values.is_null().to_numpy(zero_copy_only=False))
    if len(empty) and unknown is None:
        raise ColumnError(expected, "nothing", empty.tolist())
    if kind == "str":
        return np.array([unknown if value is None else value for value in values.to_pylist()], str)
    if pa.types.is_null(values.type):
        return np.full(len(values), unknown, _DTYPES[kind])
    numbers = pc.fill_null(values, pa.scalar(unknown, values.type)) if len(empty) else values
    array = numbers.to_numpy(zero_copy_only=False)
    if kind == "int" and array.dtype.kind == "f":
        broken = np.flatnonzero(~(np.isfinite(array) & (array == np.rint(array)) & (np.abs(array) < 2**62)))
        if len(broken):
            raise ColumnError(expected, "others", broken.tolist())
    if kind == "int" and array.dtype == np.uint64 and array.size and array.max() >= 2**63:
        raise ColumnError(expected, f"{array.max()}")
    return array.astype(_DTYPES[kind])


def vectors(column: pa.ChunkedArray, width: int | None = None) -> np.ndarray:
    """`(N,)` or `(N, n)` a column of numbers, or of lists of as many numbers in every row.

    Args:
        width: numbers a row; a list of one may also be a single number. None for whatever there is.

    Raises:
        ColumnError: values that are no numbers, rows of another or several widths, or an empty entry.
    """
    values = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    rows = len(values)
    expected = "numbers" if width is None else f"{width} numbers" if width > 1 else "a number"
    expected += " in every row"
    listed = is_list(values.type)
    empty = np.flatnonzero(values.is_null().to_numpy(zero_copy_only=False))
    if len(empty):
        raise ColumnError(expected, "nothing", empty.tolist())
    found_width = 1
    if listed:
        lengths = _lengths(values)
        found_width = int(lengths[0]) if rows else (width or 1)
        wrong = np.flatnonzero(lengths != (found_width if width is None else width))
        if len(wrong):
            widths = sorted(set(lengths.tolist()))
            raise ColumnError(expected, f"{', '.join(map(str, widths[:3]))} a row", wrong.tolist())
        values = values.flatten()
        if is_list(values.type):
            raise ColumnError(expected, "lists of lists")
        holes = np.flatnonzero(values.is_null().to_numpy(zero_copy_only=False))
        if len(holes):
            raise ColumnError(expected, "nothing", sorted({int(hole) // found_width for hole in holes}))
    elif width is not None and width > 1:
        raise ColumnError(expected, str(values.type))
    if not (pa.types.is_integer(values.type) or pa.types.is_floating(values.type) or pa.types.is_boolean(values.type)):
        raise ColumnError(expected, str(column.type))
    array = values.to_numpy(zero_copy_only=False)
    return array.reshape(rows, found_width) if listed else array


def feature_values(table: pa.Table, name: str, shape: Sequence[int], path: Path) -> np.ndarray:
    """`(N, n)` numbers of a feature, `(N,)` where it has one number a frame.

    Args:
        shape: of the feature, as `meta/info.json` has it.
        path: of the file, for the error.

    Raises:
        FileFormatError: the column is missing or holds something else.
    """
    if name not in table.column_names:
        raise FileFormatError(path, f"a column {name}", "none")
    width = math.prod(shape)
    try:
        values = vectors(table.column(name), width)
    except ColumnError as error:
        raise FileFormatError(path, f"{error.expected} of {name}", _with_rows(error)) from None
    return values.reshape(-1) if width == 1 else values


def misfit(column: pa.ChunkedArray, dtype: str, shape: Sequence[int]) -> str:
    """What a column of frames holds where a feature of one axis needs numbers; empty where it fits.

    Empty values fit: whether they are read depends on the episodes in use.

    Args:
        dtype: of the feature, such as `float32`.
        shape: of the feature, such as `(4,)`; numbers of a feature of one may stand alone.
    """
    values, width = column.combine_chunks(), math.prod(shape)
    listed = is_list(values.type)
    kind = values.type.value_type if listed else values.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        return str(values.type)
    if listed:
        lengths = _lengths(values)
        wrong = lengths[values.is_valid().to_numpy(zero_copy_only=False) & (lengths != width)]
        if len(wrong):
            return f"{int(wrong[0])} numbers in a row"
        values = values.flatten()
    elif width > 1:
        return str(values.type)
    if "int" in dtype and pa.types.is_floating(kind):
        numbers = values.drop_null().to_numpy(zero_copy_only=False)
        if not np.array_equal(numbers, np.rint(numbers)):
            return "fractions"
    return ""


def episode_values(table: pa.Table, name: str, kind: str, path: Path, unknown: Any = None) -> np.ndarray:
    """`(E,)` an episode column, see `scalars`.

    Raises:
        FileFormatError: the column is missing or holds something else; the line names the episodes.
    """
    if name not in table.column_names:
        raise FileFormatError(path, f"a column {name}", "none")
    try:
        return scalars(table.column(name), kind, unknown)
    except ColumnError as error:
        raise FileFormatError(path, f"{error.expected} of {name}", _with_rows(error)) from None


def _repeated(names: Sequence[str]) -> str:
    return next(name for name in names if names.count(name) > 1)


def _with_rows(error: ColumnError) -> str:
    if not error.rows:
        return error.found
    named = ", ".join(map(str, error.rows[:3])) + (", ..." if len(error.rows) > 3 else "")
    return f"{error.found} in row {named}" if len(error.rows) == 1 else f"{error.found} in rows {named}"


def _fits(kind: pa.DataType, wanted: str) -> bool:
    if wanted == "str":
        return pa.types.is_string(kind) or pa.types.is_large_string(kind)
    if wanted == "bool":
        return pa.types.is_boolean(kind)
    return pa.types.is_integer(kind) or pa.types.is_floating(kind)


def _lengths(values: Any) -> np.ndarray:
    if pa.types.is_fixed_size_list(values.type):
        return np.full(len(values), values.type.list_size)
    return values.value_lengths().to_numpy(zero_copy_only=False)
