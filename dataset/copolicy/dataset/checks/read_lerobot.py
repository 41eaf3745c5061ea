"""Reads a LeRobot v3 data set as `EpisodeData`; damaged files become findings."""

from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..episode import EPISODE_COLUMNS, LATER_COLUMNS, UNKNOWN_VALUES
from ..exceptions import FileFormatError
from ..features import ACTION, STATE, VECTORS, features_of
from ..files.listing import visible_files
from ..files.meta_files import EPISODES_FOLDER, INFO_FILE
from ..lerobot_folder.folder import POSITIONS, task_mismatch
from ..lerobot_folder.info import read_info, require_episodes, task_of
from ..lerobot_folder.tables import ColumnError, column_types, pa, read_parquet, scalars, vectors
from .episode_data import EpisodeData
from .finding import Finding

CLOCK = ("timestamp", "frame_index", "episode_index", "index", "task_index")
"""The frame columns that LeRobot adds."""


def read_lerobot(root: Path) -> EpisodeData:
    """Reads everything that the rules need from a data set: all columns except images.

    Raises:
        FileFormatError: the folder is not a LeRobot v3 data set of an installed task, or meta/episodes is unreadable.
    """
    info = read_info(root)
    require_episodes(root, info)
    features = features_of(task_of(info).spec)
    damage: list[Finding] = []
    meta = _concatenated(root, EPISODES_FOLDER, damage)[0]
    if meta is None:
        raise FileFormatError(root / EPISODES_FOLDER, "a table with episode_index and length", "none that can be read")
    columns = _episode_columns(root, meta, damage)
    order = np.argsort(columns["episode_index"], kind="stable")
    columns = {name: values[order] for name, values in columns.items()}
    labels = tuple(str(index) for index in columns["episode_index"])
    data, episodes_of_files = _concatenated(root, "data", damage)
    frames: dict[str, Array] = {}
    files: dict[str, tuple[str, int]] = {}
    if data is not None:
        files = {column.name: _type_and_width(column.type) for column in data.schema}
        _require_task(root, info, files)
        frames = _frame_columns(data, features, damage)
    frames, framed, starts = _complete_episodes(frames, columns, labels, damage)
    counts = (len(labels), data.num_rows if data is not None else 0)
    for name, count in zip(("total_episodes", "total_frames"), counts, strict=True):
        if info[name] != count:
            message = f"{name} of meta/info.json differs from the files"
            damage.append(Finding("", "rows", count, info[name], "error", message))
    return EpisodeData(
        root, "lerobot", float(info["fps"]), labels, columns, frames, framed, starts, None, info, files,
        tuple(damage), meta.take(pa.array(order)), episodes_of_files, task_of(info),
    )  # fmt: skip


def _require_task(root: Path, info: dict[str, Any], files: dict[str, tuple[str, int]]) -> None:
    """Refuses a data set of another task, whose columns have other widths."""
    widths = {name: files[name][1] if name in files else None for name in (STATE, ACTION)}
    spec = task_of(info).spec
    difference = task_mismatch(info)
    if difference and widths != {STATE: len(spec.state), ACTION: len(spec.joint_action)}:
        raise FileFormatError(root / INFO_FILE, f"a data set of {spec.title} (copolicy-convert)", difference)


def _episode_columns(root: Path, meta: "pa.Table", damage: list[Finding]) -> dict[str, Array]:
    """The valid columns of meta/episodes; problems of the others are added to `damage`.

    Raises:
        FileFormatError: `episode_index` or `length` is missing, or has an invalid value.
    """
    path = root / EPISODES_FOLDER
    columns: dict[str, Array] = {}
    for name in (*POSITIONS, *EPISODE_COLUMNS):
        if name not in meta.column_names:
            if name in POSITIONS[:2]:
                raise FileFormatError(path, "a table with episode_index and length", f"none named {name}")
            if name in POSITIONS:
                message = f"meta/episodes has no column {name}, without which LeRobot loads no episode"
                damage.append(Finding("", "schema", None, None, "error", message))
            elif name in LATER_COLUMNS:
                columns[name] = np.full(meta.num_rows, UNKNOWN_VALUES[name])
            continue
        type_name = EPISODE_COLUMNS.get(name, "int")
        default = UNKNOWN_VALUES.get(name)
        try:
            columns[name] = scalars(meta.column(name), type_name, default)
        except ColumnError as error:
            if name in POSITIONS[:2]:
                raise FileFormatError(path, f"{error.expected} of {name}", error.found) from None
            message = f"episode column {name}: expected {error.expected}, found {error.found}"
            damage.append(Finding("", "schema", len(error.rows) or None, 0 if error.rows else None, "error", message))
            continue
        nulls = meta.column(name).null_count
        # LeRobot's merge writes NaN, "not measured", as null.
        if nulls and type_name != "float" and name not in LATER_COLUMNS:
            message = f"episodes with null in column {name}, as after a merge with a set that lacks it"
            damage.append(Finding("", "schema", nulls, 0, "error", message))
    for name in ("episode_index", "length"):
        invalid = np.flatnonzero((columns[name] < (name == "length")) | (columns[name] > 2**40))
        if len(invalid):
            raise FileFormatError(path, f"a usable {name} in every row", str(columns[name][invalid[0]]))
    return columns


def _frame_columns(data: "pa.Table", features: dict[str, dict], damage: list[Finding]) -> dict[str, Array]:
    """The frame columns with a number in every row; problems of the others are added to `damage`."""
    frames: dict[str, Array] = {}
    needed = (*features, *CLOCK)
    for name in data.column_names:
        try:
            values = vectors(data.column(name))
            width = features[name]["shape"][0] if name in features else 1 if name in CLOCK else None
            if width is None or values.size == width * len(values):
                frames[name] = values if width is None else values.reshape((-1, width) if name in VECTORS else -1)
            # A wrong width is a finding of the rule `features`.
        except ColumnError as error:
            if name in needed:
                message = f"column {name} of the frames: expected {error.expected}, found {error.found}"
                message += _episodes_of_rows(data, error)
                figure = len(error.rows) or None
                damage.append(Finding("", "schema", figure, 0 if figure else None, "error", message))
    for name in CLOCK:
        if name not in data.column_names:
            message = f"no column {name} in the data files, without which LeRobot loads no episode"
            damage.append(Finding("", "schema", None, None, "error", message))
    return frames


def _episodes_of_rows(data: "pa.Table", error: ColumnError) -> str:
    """Text with the episodes of the invalid rows; empty if unknown."""
    if not error.rows or "episode_index" not in data.column_names:
        return ""
    try:
        numbers = scalars(data.column("episode_index"), "int")
    except ColumnError:
        return ""
    episodes = sorted(set(numbers[list(error.rows)].tolist()))
    listed = ", ".join(map(str, episodes[:5])) + (", ..." if len(episodes) > 5 else "")
    return f", in episode {listed}" if len(episodes) == 1 else f", in episodes {listed}"


def _concatenated(
    root: Path, folder: str, damage: list[Finding]
) -> "tuple[pa.Table | None, dict[str, frozenset[int]]]":
    """All Parquet files of a folder, without columns of statistics and images, and the episodes in each file."""
    tables, episodes = [], {}
    for path in visible_files(root / folder, "*.parquet"):
        name = path.relative_to(root).as_posix()
        try:
            table = read_parquet(path, [name for name, kind in column_types(path).items() if _is_needed(name, kind)])
        except FileFormatError as error:
            message = f"{name} cannot be read: {str(error).removeprefix(f'{path}: ')}"
            damage.append(Finding("", "check_sum", None, None, "error", message))
            continue
        tables.append(table)
        try:
            numbers = scalars(table.column("episode_index"), "int", -1) if "episode_index" in table.column_names else ()
        except ColumnError:
            numbers = ()
        episodes[name] = frozenset(np.unique(numbers).tolist())
    if not tables:
        damage.append(Finding("", "check_sum", 0, 1, "error", f"no Parquet file in {folder} can be read"))
        return None, episodes
    try:
        return pa.concat_tables(tables, promote_options="permissive").combine_chunks(), episodes
    except pa.ArrowException as error:
        damage.append(Finding("", "schema", None, None, "error", f"files of {folder} disagree: {error}"))
        return tables[0], episodes


def _is_needed(name: str, kind: "pa.DataType") -> bool:
    return not name.startswith("stats/") and not pa.types.is_struct(kind)


def _type_and_width(kind: "pa.DataType") -> tuple[str, int]:
    if pa.types.is_fixed_size_list(kind):
        return str(kind.value_type), kind.list_size
    return str(kind), 1


def _complete_episodes(
    frames: dict[str, Array], columns: dict[str, Array], labels: tuple[str, ...], damage: list[Finding]
) -> tuple[dict[str, Array], Array, Array]:
    """The frames of the episodes with the right number of rows, in episode order; other episodes become findings."""
    empty = np.array([], np.int64)
    numbers = frames.get("episode_index")
    if numbers is None or numbers.ndim != 1 or numbers.dtype.kind != "i":
        return {}, empty, empty
    order = np.arange(len(frames["episode_index"]))
    if np.any(np.diff(frames["episode_index"]) < 0):
        order = np.argsort(frames["episode_index"], kind="stable")
    numbers, counts = np.unique(frames["episode_index"], return_counts=True)
    rows = dict(zip(numbers.tolist(), counts.tolist(), strict=True))
    row_counts = np.array([rows.get(index, 0) for index in columns["episode_index"].tolist()], np.int64)
    whole = (row_counts == columns["length"]) & (row_counts > 0)
    _, first, times = np.unique(columns["episode_index"], return_index=True, return_counts=True)
    whole[np.setdiff1d(np.arange(len(labels)), first)] = False
    for index in first[times > 1]:
        damage.append(Finding(labels[index], "rows", 2, 1, "error", "more than one row in meta/episodes"))
    for index in np.flatnonzero(row_counts != columns["length"]):
        length = int(columns["length"][index])
        damage.append(Finding(labels[index], "rows", int(row_counts[index]), length, "error", "wrong number of frames"))
    unknown = np.setdiff1d(numbers, columns["episode_index"])
    for number in unknown.tolist():
        damage.append(Finding(str(number), "rows", rows[number], 0, "error", "frames of an episode without metadata"))
    framed = np.flatnonzero(whole)
    if not len(framed):
        return {}, empty, empty
    kept_rows = order[np.isin(frames["episode_index"][order], columns["episode_index"][framed])]
    lengths = row_counts[framed]
    if len(kept_rows) == len(order) and np.array_equal(kept_rows, np.arange(len(order))):
        return frames, framed, np.cumsum(lengths) - lengths
    return {name: values[kept_rows] for name, values in frames.items()}, framed, np.cumsum(lengths) - lengths
