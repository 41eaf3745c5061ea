"""Reads, selects and atomically rewrites the rows of meta/episodes as tables."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..episode import EPISODE_COLUMNS
from ..exceptions import FileFormatError, InvalidValueError
from ..files.staging import replacements
from .info import episode_files, stripped_hint

if TYPE_CHECKING:
    import pyarrow as pa


def episode_tables(root: Path, needed: Sequence[str] = ()) -> "dict[Path, pa.Table]":
    """Reads the files of meta/episodes as tables, in the order of their paths.

    Args:
        needed: columns that each file must have.

    Raises:
        FileFormatError: no LeRobot data set, a damaged file, or a missing column.
    """
    from .folder import LeRobotFolder
    from .tables import read_parquet

    # Checks the types of all columns before any of them is rewritten.
    folder = LeRobotFolder.open(root)
    folder.rows([name for name in needed if name in EPISODE_COLUMNS])
    tables = {}
    for path in episode_files(root):
        tables[path] = read_parquet(path)
        missing = [name for name in needed if name not in tables[path].column_names]
        if missing:
            hint = stripped_hint(folder.info, root) if "episode_uuid" in missing else ""
            raise FileFormatError(path, "the episode columns of copolicy", f"none named {', '.join(missing)}{hint}")
    return tables


def select_episodes(texts: Iterable[str], numbers: Iterable[int], names: Mapping[str, int]) -> set[int]:
    """Resolves texts such as `12`, `3-5` or an `episode_uuid` to episode numbers.

    Args:
        numbers: numbers of all episodes.
        names: episode number by `episode_uuid`.

    Raises:
        InvalidValueError: no such episode, or a text of another form.
    """
    numbers = set(numbers)
    chosen: set[int] = set()
    for text in texts:
        if text in names:
            chosen.add(names[text])
            continue
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", text)
        # The range is limited first: it may have more numbers than fit into memory.
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        requested = set(range(first, min(last, first + len(numbers)) + 1))
        if not requested or not requested <= numbers:
            expected = f"numbers from 0 to {max(numbers, default=0)}, ranges such as 3-5, or existing episode_uuids"
            raise InvalidValueError("--episode-ids", expected, text)
        chosen |= requested
    return chosen


def with_column(table: "pa.Table", name: str, values: Sequence[Any], type_name: str) -> "pa.Table":
    """Returns the table with new values in an episode column, which is added if missing.

    Args:
        type_name: `str`, `int`, `float` or `bool`; needed because a column of nulls, as after a merge with a data set
            without it, has no type.
    """
    import pyarrow as pa

    arrow_type = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}[type_name]
    position = table.schema.get_field_index(name)
    field = pa.field(name, arrow_type)
    array = pa.array(values, arrow_type)
    return table.append_column(field, array) if position < 0 else table.set_column(position, field, array)


def write_tables(tables: "Mapping[Path, pa.Table]", texts: Mapping[Path, str] | None = None) -> None:
    """Replaces files of meta/episodes by tables and other files by texts.

    All new files are synced to disk before the first is renamed: a crash leaves old or new files, never a partial
    one, and repeating the call completes it.
    """
    import pyarrow.parquet as pq

    texts = texts or {}
    with replacements([*tables, *texts]) as partials:
        for table, partial in zip(tables.values(), partials, strict=False):
            pq.write_table(table, partial, compression="snappy")
        for text, partial in zip(texts.values(), partials[len(tables) :], strict=True):
            partial.write_text(text, encoding="utf-8")
