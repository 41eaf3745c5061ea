"""`amend`: stated episode columns, such as a forgotten licence, corrected in place."""

import datetime
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from ..episode import EPISODE_COLUMNS, Source
from ..exceptions import InvalidValueError, RunError, UnknownNameError
from ..files.meta_files import RECORD_FILE
from ..files.replace_folder import finish_interrupted
from ..lerobot_folder.episode_rows import episode_tables, with_column, write_tables
from ..publication.licences import checked_licence
from .selection import Selection
from .subset.stored_set import record_text, stored_record

if TYPE_CHECKING:
    import pyarrow as pa

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def _name(column: str, text: str) -> None:
    if not _NAME.fullmatch(text):
        expected = "up to 64 letters, digits, '.', '_' or '-' (an id, no name of a person)"
        raise InvalidValueError(f"--set {column}", expected, text)


def _names(column: str, text: str) -> None:
    for part in text.split(","):
        _name(column, part)


def _licence(column: str, text: str) -> None:
    if not text:
        raise InvalidValueError(f"--set {column}", "a licence identifier of the Hub such as cc-by-4.0", text)
    checked_licence(text, f"--set {column}")


def _source(column: str, text: str) -> None:
    if text not in get_args(Source):
        raise InvalidValueError(f"--set {column}", f"one of {', '.join(get_args(Source))}", text)


AMENDABLE: dict[str, Callable[[str, str], None]] = {
    "license": _licence,
    "consent_id": _names,
    "session_id": _name,
    "pair_id": _name,
    "player_0_id": _name,
    "player_1_id": _name,
    "controller_0": _name,
    "controller_1": _name,
    "map_set": _name,
    "source": _source,
}
"""The columns that somebody states, and what checks a value. All others were measured or follow from the data."""

_PERSONAL = {"consent_id", "session_id", "pair_id", "player_0_id", "player_1_id"}
_ELSEWHERE = {
    "discarded": "copolicy-dataset exclude sets it",
    "quality_flags": "copolicy-dataset exclude adds a reason",
}


def parse_settings(texts: Sequence[str]) -> dict[str, str]:
    """Reads `NAME=VALUE`; an empty value says that nothing is known.

    Raises:
        InvalidValueError: another form, a value of another form, or a column that is not stated but measured.
        UnknownNameError: no such column.
    """
    settings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name in settings:
            raise InvalidValueError("--set", "NAME=VALUE, each name once", text)
        if name in EPISODE_COLUMNS and name not in AMENDABLE:
            reason = _ELSEWHERE.get(name, "it is measured, or follows from the data")
            expected = f"a column that somebody states ({', '.join(AMENDABLE)})"
            raise InvalidValueError("--set", expected, f"{name}: {reason}")
        if name not in AMENDABLE:
            raise UnknownNameError("episode column", name, AMENDABLE)
        if value:
            AMENDABLE[name](name, value)
        elif name == "source":
            _source(name, value)
        settings[name] = value
    return settings


def amend(root: Path, settings: Mapping[str, str], selection: Selection | None = None) -> dict[str, Any]:
    """Gives stated columns of some episodes other values; frames, videos and statistics stay as they are.

    The record `meta/copolicy.json` says what was amended; of what names people it keeps the column and the number of
    episodes alone.

    Args:
        settings: new values by column (`parse_settings`).
        selection: the episodes; all by default.

    Returns:
        Summary.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        RunError: no episode is meant, or each has the values already; nothing was changed.
    """
    finish_interrupted(root)
    tables = episode_tables(root, ("episode_index", "episode_uuid", *settings))
    record = stored_record(root)
    rows = _rows(tables.values())
    everything = [row for part in rows for row in part]
    everything.sort(key=lambda row: row["episode_index"])
    chosen = {row["episode_index"] for row in everything}
    if selection is not None:
        chosen = set(selection.numbers(everything, _types(everything)))
        if not chosen:
            raise RunError(f"{root}: expected at least one episode that is meant, found none; nothing was changed")
    changed: dict[str, Counter[str]] = {name: Counter() for name in settings}
    numbers: set[int] = set()
    written: dict[Path, pa.Table] = {}
    for (path, table), part in zip(tables.items(), rows, strict=True):
        after = table
        for name, value in settings.items():
            values = [row.get(name) or "" for row in part]
            for index, row in enumerate(part):
                if row["episode_index"] in chosen and values[index] != value:
                    changed[name][values[index]] += 1
                    numbers.add(row["episode_index"])
                    values[index] = value
            if values != [row.get(name) for row in part]:
                after = with_column(after, name, values, "str")
        if after is not table:
            written[path] = after
    if not numbers:
        raise RunError(f"{root}: expected an episode with another value, found none; nothing was changed")
    columns = {
        name: {"episodes": counts.total()}
        | ({} if name in _PERSONAL else {"from": sorted(counts), "to": settings[name]})
        for name, counts in changed.items()
        if counts
    }
    note = {"date": today(), "episodes": len(numbers), "columns": columns}
    text = record_text({**record, "amended": [*record.get("amended", []), note]})
    write_tables(written, {root / RECORD_FILE: text})
    return {
        "root": str(root),
        "amended": len(numbers),
        "columns": {name: counts.total() for name, counts in changed.items()},
        "next": f'copolicy-dataset release {root} --bump patch --notes "..."; findings, statistics and card anew',
    }


def today() -> str:
    """The date of a note in a record, UTC."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def _rows(tables: Any) -> list[list[dict[str, Any]]]:
    """The rows of each table with the columns that a selection asks for."""
    known = {"episode_index", "length", *EPISODE_COLUMNS}
    return [table.select([name for name in table.column_names if name in known]).to_pylist() for table in tables]


def _types(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    types = {"episode_index": "int", "length": "int", **EPISODE_COLUMNS}
    return {name: kind for name, kind in types.items() if any(name in row for row in rows)}
