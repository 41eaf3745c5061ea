"""A LeRobot v3 data set as an `EpisodeTable`, read with pyarrow so that a broken file is a finding, not an end."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..episode import EPISODE_COLUMNS, LATER_COLUMNS, LATER_DEFAULTS
from ..exceptions import FileFormatError, MissingExtraError
from ..files import visible_files
from .episode_table import COLUMN_TYPES, EpisodeTable
from .finding import Finding

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

CLOCK = ("timestamp", "frame_index", "episode_index", "index")
"""The columns of the frames that LeRobot itself adds."""

_EMPTY: dict[str, Any] = {"str": "", "float": float("nan"), "int": -1, "bool": False}
_META = ("episode_index", "length", "dataset_from_index", "dataset_to_index")


def read_lerobot(root: Path) -> EpisodeTable:
    """Everything about a data set that the rules look at: numbers and flags, no pictures.

    Raises:
        FileFormatError: `meta/info.json` is no JSON object, or no table of episodes can be read at all.
    """
    info = _info(root)
    damage: list[Finding] = []
    meta = _concatenated(root, "meta/episodes", damage)
    if meta is None or any(name not in meta.column_names for name in ("episode_index", "length")):
        raise FileFormatError(
            root / "meta" / "episodes", "a table with episode_index and length", "none that can be read"
        )
    columns = {name: _column(meta, name) for name in (*_META, *EPISODE_COLUMNS) if name in meta.column_names}
    for name in columns:
        nulls = meta.column(name).null_count
        # LeRobot's merge writes NaN, "not measured", as null.
        if nulls and EPISODE_COLUMNS.get(name) != "float" and name not in LATER_COLUMNS:
            message = f"episodes with nothing in column {name}, as after a merge with a set that lacks it"
            damage.append(Finding("", "schema", nulls, 0, "error", message))
    for name, default in LATER_DEFAULTS.items():
        columns.setdefault(name, np.full(meta.num_rows, default))
    order = np.argsort(columns["episode_index"], kind="stable")
    columns = {name: values[order] for name, values in columns.items()}
    labels = tuple(str(index) for index in columns["episode_index"])
    data = _concatenated(root, "data", damage)
    frames: dict[str, np.ndarray] = {}
    files: dict[str, tuple[str, int]] = {}
    if data is not None:
        files = {column.name: _type(column.type) for column in data.schema}
        frames = {name: values for name in data.column_names if (values := _numbers(data, name)) is not None}
    frames, framed, starts = _whole_episodes(frames, columns, labels, damage)
    found = (len(labels), data.num_rows if data is not None else 0)
    for name, number in zip(("total_episodes", "total_frames"), found, strict=True):
        if info.get(name) != number:
            message = f"meta/info.json has another {name} than the files"
            damage.append(Finding("", "rows", number, _figure(info.get(name)), "error", message))
    return EpisodeTable(
        root, "lerobot", _rate(info), labels, columns, frames, framed, starts, None, None, info, files, tuple(damage)
    )


def _info(root: Path) -> dict[str, Any]:
    path = root / "meta" / "info.json"
    try:
        info = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileFormatError(root, "recordings (*.mcap) or a LeRobot data set (meta/info.json)", "neither") from None
    except ValueError as error:
        raise FileFormatError(path, "LeRobot's data set information", str(error)) from None
    if not isinstance(info, dict):
        raise FileFormatError(path, "LeRobot's data set information", type(info).__name__)
    return info


def _rate(info: dict[str, Any]) -> float:
    fps = info.get("fps")
    return float(fps) if isinstance(fps, int | float) and fps > 0 else 0.0


def _figure(value: object) -> float | int | str | None:
    return value if isinstance(value, int | float | str) or value is None else str(value)


def _concatenated(root: Path, folder: str, damage: list[Finding]) -> "pa.Table | None":
    """All Parquet files of a folder, without statistics of episodes and without nested columns such as pictures."""
    tables = []
    for path in visible_files(root / folder, "*.parquet"):
        try:
            with pq.ParquetFile(path) as file:
                names = [field.name for field in file.schema_arrow if _wanted(field)]
                tables.append(file.read(columns=names))
        except (pa.ArrowException, OSError) as error:
            message = f"{path.relative_to(root).as_posix()} cannot be read: {str(error).splitlines()[0]}"
            damage.append(Finding("", "check_sum", None, None, "error", message))
    if not tables:
        damage.append(Finding("", "check_sum", 0, 1, "error", f"no Parquet file in {folder} can be read"))
        return None
    try:
        return pa.concat_tables(tables, promote_options="permissive").combine_chunks()
    except pa.ArrowException as error:
        damage.append(Finding("", "schema", None, None, "error", f"files of {folder} disagree: {error}"))
        return tables[0]


def _wanted(field: "pa.Field") -> bool:
    kind = field.type
    if field.name.startswith("stats/") or pa.types.is_struct(kind):
        return False
    return not pa.types.is_nested(kind) or pa.types.is_primitive(kind.value_type)


def _type(kind: "pa.DataType") -> tuple[str, int]:
    if pa.types.is_fixed_size_list(kind):
        return str(kind.value_type), kind.list_size
    return str(kind), 1


def _numbers(data: "pa.Table", name: str) -> np.ndarray | None:
    """`(N,)` or `(N, n)` numbers of a column; None where it holds something else or has rows of several lengths."""
    column = data.column(name)
    if column.num_chunks == 0 or column.null_count:
        return None
    kind = column.type
    flat = column.combine_chunks()
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        if not pa.types.is_primitive(kind.value_type):
            return None
        values = flat.flatten()
        if values.null_count or not data.num_rows or len(values) % data.num_rows:
            return None
        if not pa.types.is_fixed_size_list(kind) and len(set(flat.value_lengths().to_pylist())) > 1:
            return None
        return values.to_numpy(zero_copy_only=False).reshape(data.num_rows, -1)
    if pa.types.is_primitive(kind):
        return flat.to_numpy(zero_copy_only=False)
    return None


def _column(meta: "pa.Table", name: str) -> np.ndarray:
    """`(E,)` an episode column; a missing entry is an empty text, NaN, -1 or False, and `schema` reports it."""
    column = meta.column(name)
    kind = EPISODE_COLUMNS.get(name, "int")
    values = [_EMPTY[kind] if value is None else value for value in column.to_pylist()]
    try:
        return np.array(values, COLUMN_TYPES[kind])
    except (TypeError, ValueError):
        return np.array([str(value) for value in values])


def _whole_episodes(
    frames: dict[str, np.ndarray], columns: dict[str, np.ndarray], labels: tuple[str, ...], damage: list[Finding]
) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """The frames of the episodes that have as many rows as they should, in the order of the episodes."""
    nothing = np.array([], np.int64)
    if "episode_index" not in frames:
        return {}, nothing, nothing
    order = np.arange(len(frames["episode_index"]))
    if np.any(np.diff(frames["episode_index"]) < 0):
        order = np.argsort(frames["episode_index"], kind="stable")
    numbers, counts = np.unique(frames["episode_index"], return_counts=True)
    rows = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    found = np.array([rows.get(index, 0) for index in columns["episode_index"].tolist()], np.int64)
    whole = (found == columns["length"]) & (found > 0)
    _, first, times = np.unique(columns["episode_index"], return_index=True, return_counts=True)
    whole[np.setdiff1d(np.arange(len(labels)), first)] = False
    for place in first[times > 1]:
        damage.append(Finding(labels[place], "rows", 2, 1, "error", "more than one row in meta/episodes"))
    for place in np.flatnonzero(found != columns["length"]):
        length = int(columns["length"][place])
        damage.append(Finding(labels[place], "rows", int(found[place]), length, "error", "another number of frames"))
    strangers = np.setdiff1d(numbers, columns["episode_index"])
    for number in strangers.tolist():
        damage.append(Finding(str(number), "rows", rows[number], 0, "error", "frames of an episode without metadata"))
    framed = np.flatnonzero(whole)
    if not len(framed):
        return {}, nothing, nothing
    kept = order[np.isin(frames["episode_index"][order], columns["episode_index"][framed])]
    lengths = found[framed]
    if len(kept) == len(order) and np.array_equal(kept, np.arange(len(order))):
        return frames, framed, np.cumsum(lengths) - lengths
    return {name: values[kept] for name, values in frames.items()}, framed, np.cumsum(lengths) - lengths
