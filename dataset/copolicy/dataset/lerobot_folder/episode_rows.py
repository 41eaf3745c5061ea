"""The rows of meta/episodes as tables: read, chosen by number or name, and written back whole."""

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
    """The files of meta/episodes, each as a table, in the order of their paths.

    Args:
        needed: columns that each file must have.

    Raises:
        FileFormatError: no LeRobot data set, a damaged file, or one that lacks a needed column.
        MissingExtraError: pyarrow is not installed.
    """
    from .folder import LeRobotFolder
    from .tables import read_parquet

    # The types of all columns, before any of them is rewritten.
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


def chosen_episodes(texts: Iterable[str], numbers: Iterable[int], names: Mapping[str, int]) -> set[int]:
    """The episodes that `12`, `3-5` or an `episode_uuid` stand for.

    Args:
        numbers: of all episodes.
        names: number of each `episode_uuid`.

    Raises:
        InvalidValueError: an episode that is not there, or a text of another form.
    """
    numbers = set(numbers)
    chosen: set[int] = set()
    for text in texts:
        if text in names:
            chosen.add(names[text])
            continue
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", text)
        # The end is cut first: a range may name more numbers than fit into memory.
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, -1)
        wanted = set(range(first, min(last, first + len(numbers)) + 1))
        if not wanted or not wanted <= numbers:
            span = f"numbers from 0 to {max(numbers, default=0)}, ranges such as 3-5, or episode_uuids of the data set"
            raise InvalidValueError("--episode-ids", span, text)
        chosen |= wanted
    return chosen


def with_column(table: "pa.Table", name: str, values: Sequence[Any], kind: str) -> "pa.Table":
    """The table with other values in an episode column.

    Args:
        kind: `str`, `int`, `float` or `bool`. A column of nulls alone has no type yet, as after a merge with a set
            that lacks it.
    """
    import pyarrow as pa

    arrow = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}[kind]
    position = table.schema.get_field_index(name)
    field = pa.field(name, arrow)
    array = pa.array(values, arrow)
    return table.append_column(field, array) if position < 0 else table.set_column(position, field, array)


def write_tables(tables: "Mapping[Path, pa.Table]", texts: Mapping[Path, str] | None = None) -> None:
    """Puts tables in the place of the files of meta/episodes, and texts in that of others.

    All new files are complete on the disk before the first takes its place, each in one step: a crash leaves old or
    new files, never half of one, and the same call again completes what it began.
    """
    import pyarrow.parquet as pq

    texts = texts or {}
    with replacements([*tables, *texts]) as partials:
        for table, partial in zip(tables.values(), partials, strict=False):
            pq.write_table(table, partial, compression="snappy")
        for text, partial in zip(texts.values(), partials[len(tables) :], strict=True):
            partial.write_text(text, encoding="utf-8")
