"""Reads Parquet tables of a LeRobot data set and checks the types of their columns."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..arrays import Array
from ..exceptions import FileFormatError

DAMAGED = (pa.ArrowException, OSError, ValueError)
"""Exceptions that pyarrow raises for an incomplete Parquet file."""
_LISTS = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
_TYPE_NAMES = {"str": "texts", "int": "whole numbers", "float": "numbers", "bool": "true or false"}
_DTYPES: dict[str, Any] = {"int": np.int64, "float": np.float64, "bool": bool}


class ColumnError(ValueError):
    """A column with other values than expected.

    Attributes:
        expected: description of the expected values.
        found: description of the values found.
        rows: rows of the wrong values, empty if the whole column is wrong.
    """

    def __init__(self, expected: str, found: str, rows: Sequence[int] = ()):
        super().__init__(f"expected {expected}, found {found}")
        self.expected, self.found, self.rows = expected, found, tuple(rows)


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> pa.Table:
    """Reads one Parquet file.

    Args:
        columns: columns to read, all of which must exist; None reads all.

    Raises:
        FileFormatError: an incomplete Parquet file, or a missing column.
    """
    try:
        # Not as a pyarrow data set, which would read the folder chunk-000 as a partition key.
        with pq.ParquetFile(path) as file:
            present = file.schema_arrow.names
            missing = [name for name in columns or () if name not in present]
            if missing:
                raise FileFormatError(path, "the columns of copolicy", f"none named {', '.join(missing)}")
            if len(set(present)) < len(present):
                raise FileFormatError(path, "each column once", f"{_first_repeated(present)} twice")
            return file.read(columns=None if columns is None else list(columns))
    except DAMAGED as error:
        raise damaged(path, error) from None


def column_types(path: Path) -> dict[str, pa.DataType]:
    """Type of each column of a file by name.

    Raises:
        FileFormatError: an incomplete Parquet file.
    """
    try:
        with pq.ParquetFile(path) as file:
            return {field.name: field.type for field in file.schema_arrow}
    except DAMAGED as error:
        raise damaged(path, error) from None


def row_count(path: Path) -> int:
    """Number of rows of a file.

    Raises:
        FileFormatError: an incomplete Parquet file.
    """
    try:
        with pq.ParquetFile(path) as file:
            return file.metadata.num_rows
    except DAMAGED as error:
        raise damaged(path, error) from None


def damaged(path: Path, error: Exception) -> FileFormatError:
    """The error for a file that pyarrow cannot read."""
    found = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
    return FileFormatError(path, "a complete Parquet file", found)


def is_list(column_type: pa.DataType) -> bool:
    """Whether a column type is a list, of fixed or variable length."""
    return any(test(column_type) for test in _LISTS)


def scalars(column: pa.ChunkedArray, type_name: str, unknown: Any = None) -> Array:
    """Converts a column of single values to an array `(N,)`.

    Args:
        type_name: `str`, `int`, `float` or `bool`, as in `EPISODE_COLUMNS`; whole numbers may be stored as floats.
        unknown: replaces nulls; None if nulls are an error.

    Raises:
        ColumnError: values of another type, or a null.
    """
    values = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if pa.types.is_dictionary(values.type):
        values = values.dictionary_decode()
    expected = f"{_TYPE_NAMES[type_name]} in every row" if unknown is None else _TYPE_NAMES[type_name]
    if not (_has_type(values.type, type_name) or (pa.types.is_null(values.type) and unknown is not None)):
        raise ColumnError(expected, str(values.type))
    empty = np.flatnonzero(values.is_null().to_numpy(zero_copy_only=False))
    if len(empty) and unknown is None:
        raise ColumnError(expected, "nothing", empty.tolist())
    if type_name == "str":
        return np.array([unknown if value is None else value for value in values.to_pylist()], str)
    if pa.types.is_null(values.type):
        return np.full(len(values), unknown, _DTYPES[type_name])
    numbers = pc.fill_null(values, pa.scalar(unknown, values.type)) if len(empty) else values
    array = numbers.to_numpy(zero_copy_only=False)
    if type_name == "int" and array.dtype.kind == "f":
        invalid = np.flatnonzero(~(np.isfinite(array) & (array == np.rint(array)) & (np.abs(array) < 2**62)))
        if len(invalid):
            raise ColumnError(expected, "others", invalid.tolist())
    if type_name == "int" and array.dtype == np.uint64 and array.size and array.max() >= 2**63:
        raise ColumnError(expected, f"{array.max()}")
    return array.astype(_DTYPES[type_name])


def vectors(column: pa.ChunkedArray, width: int | None = None) -> Array:
    """Converts a column of numbers to an array `(N,)`, or of equally long lists of numbers to `(N, n)`.

    Args:
        width: numbers per row; for 1 the column may have lists or single numbers. None allows any width.

    Raises:
        ColumnError: other values than numbers, rows of another or varying width, or a null.
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
        nulls = np.flatnonzero(values.is_null().to_numpy(zero_copy_only=False))
        if len(nulls):
            raise ColumnError(expected, "nothing", sorted({int(position) // found_width for position in nulls}))
    elif width is not None and width > 1:
        raise ColumnError(expected, str(values.type))
    if not (pa.types.is_integer(values.type) or pa.types.is_floating(values.type) or pa.types.is_boolean(values.type)):
        raise ColumnError(expected, str(column.type))
    array = values.to_numpy(zero_copy_only=False)
    return array.reshape(rows, found_width) if listed else array


def feature_values(table: pa.Table, name: str, shape: Sequence[int], path: Path) -> Array:
    """Numbers of a feature, `(N, n)`, or `(N,)` for one number per frame.

    Args:
        shape: shape of the feature in `meta/info.json`.
        path: file of the table, for error messages.

    Raises:
        FileFormatError: the column is missing or has other values.
    """
    if name not in table.column_names:
        raise FileFormatError(path, f"a column {name}", "none")
    width = math.prod(shape)
    try:
        values = vectors(table.column(name), width)
    except ColumnError as error:
        raise FileFormatError(path, f"{error.expected} of {name}", _found_with_rows(error)) from None
    return values.reshape(-1) if width == 1 else values


def type_mismatch(column: pa.ChunkedArray, dtype: str, shape: Sequence[int]) -> str:
    """Describes values of a column that do not fit a numeric feature of one axis; empty if they fit.

    Nulls fit, because whether they are read depends on the episodes in use.

    Args:
        dtype: type of the feature, such as `float32`.
        shape: shape of the feature, such as `(4,)`; for `(1,)` the column may have single numbers.
    """
    values, width = column.combine_chunks(), math.prod(shape)
    is_listed = is_list(values.type)
    value_type = values.type.value_type if is_listed else values.type
    if not (pa.types.is_integer(value_type) or pa.types.is_floating(value_type) or pa.types.is_boolean(value_type)):
        return str(values.type)
    if is_listed:
        lengths = _lengths(values)
        wrong_lengths = lengths[values.is_valid().to_numpy(zero_copy_only=False) & (lengths != width)]
        if len(wrong_lengths):
            return f"{int(wrong_lengths[0])} numbers in a row"
        values = values.flatten()
    elif width > 1:
        return str(values.type)
    if "int" in dtype and pa.types.is_floating(value_type):
        numbers = values.drop_null().to_numpy(zero_copy_only=False)
        if not np.array_equal(numbers, np.rint(numbers)):
            return "fractions"
    return ""


def episode_values(table: pa.Table, name: str, type_name: str, path: Path, unknown: Any = None) -> Array:
    """Converts an episode column to an array `(E,)`, see `scalars`.

    Raises:
        FileFormatError: the column is missing or has other values; the message names the rows.
    """
    if name not in table.column_names:
        raise FileFormatError(path, f"a column {name}", "none")
    try:
        return scalars(table.column(name), type_name, unknown)
    except ColumnError as error:
        raise FileFormatError(path, f"{error.expected} of {name}", _found_with_rows(error)) from None


def _first_repeated(names: Sequence[str]) -> str:
    return next(name for name in names if names.count(name) > 1)


def _found_with_rows(error: ColumnError) -> str:
    if not error.rows:
        return error.found
    rows = ", ".join(map(str, error.rows[:3])) + (", ..." if len(error.rows) > 3 else "")
    return f"{error.found} in row {rows}" if len(error.rows) == 1 else f"{error.found} in rows {rows}"


def _has_type(column_type: pa.DataType, type_name: str) -> bool:
    if type_name == "str":
        return pa.types.is_string(column_type) or pa.types.is_large_string(column_type)
    if type_name == "bool":
        return pa.types.is_boolean(column_type)
    return pa.types.is_integer(column_type) or pa.types.is_floating(column_type)


def _lengths(values: Any) -> Array:
    if pa.types.is_fixed_size_list(values.type):
        return np.full(len(values), values.type.list_size)
    return values.value_lengths().to_numpy(zero_copy_only=False)
