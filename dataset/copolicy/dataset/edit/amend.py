"""`amend`: corrects declared episode columns, such as a missing licence, in place."""

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


def _check_name(column: str, text: str) -> None:
    if not _NAME.fullmatch(text):
        expected = "up to 64 letters, digits, '.', '_' or '-' (an id, not a person's name)"
        raise InvalidValueError(f"--set {column}", expected, text)


def _check_names(column: str, text: str) -> None:
    for part in text.split(","):
        _check_name(column, part)


def _check_licence(column: str, text: str) -> None:
    if not text:
        raise InvalidValueError(f"--set {column}", "a licence identifier of the Hub such as cc-by-4.0", text)
    checked_licence(text, f"--set {column}")


def _check_source(column: str, text: str) -> None:
    if text not in get_args(Source):
        raise InvalidValueError(f"--set {column}", f"one of {', '.join(get_args(Source))}", text)


AMENDABLE: dict[str, Callable[[str, str], None]] = {
    "license": _check_licence,
    "consent_id": _check_names,
    "session_id": _check_name,
    "pair_id": _check_name,
    "player_0_id": _check_name,
    "player_1_id": _check_name,
    "controller_0": _check_name,
    "controller_1": _check_name,
    "map_set": _check_name,
    "source": _check_source,
}
"""Columns declared by the experimenter, with a check of their values; other columns are measured or derived."""

_PERSONAL = {"consent_id", "session_id", "pair_id", "player_0_id", "player_1_id"}
_OTHER_COMMANDS = {
    "discarded": "copolicy-dataset exclude sets it",
    "quality_flags": "copolicy-dataset exclude adds a reason",
}


def parse_settings(texts: Sequence[str]) -> dict[str, str]:
    """Parses texts `NAME=VALUE`; an empty value means unknown.

    Raises:
        InvalidValueError: another form, an invalid value, or a column that is measured or derived.
        UnknownNameError: no such column.
    """
    settings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or name in settings:
            raise InvalidValueError("--set", "NAME=VALUE, each name once", text)
        if name in EPISODE_COLUMNS and name not in AMENDABLE:
            reason = _OTHER_COMMANDS.get(name, "it is measured or derived from the data")
            expected = f"a declared column ({', '.join(AMENDABLE)})"
            raise InvalidValueError("--set", expected, f"{name}: {reason}")
        if name not in AMENDABLE:
            raise UnknownNameError("episode column", name, AMENDABLE)
        if value:
            AMENDABLE[name](name, value)
        elif name == "source":
            _check_source(name, value)
        settings[name] = value
    return settings


def amend(root: Path, settings: Mapping[str, str], selection: Selection | None = None) -> dict[str, Any]:
    """Changes declared columns of some episodes; frames, videos and statistics stay unchanged.

    `meta/copolicy.json` records the change; for columns that identify people it omits the old and new values.

    Args:
        settings: new values by column (`parse_settings`).
        selection: episodes to change; all by default.

    Returns:
        Summary.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        RunError: no episode is selected, or all have these values already; nothing was changed.
    """
    finish_interrupted(root)
    tables = episode_tables(root, ("episode_index", "episode_uuid", *settings))
    record = stored_record(root)
    rows = _rows(tables.values())
    all_rows = [row for table_rows in rows for row in table_rows]
    all_rows.sort(key=lambda row: row["episode_index"])
    selected = {row["episode_index"] for row in all_rows}
    if selection is not None:
        selected = set(selection.numbers(all_rows, _column_types(all_rows)))
        if not selected:
            raise RunError(f"{root}: expected at least one selected episode, found none; nothing was changed")
    old_values: dict[str, Counter[str]] = {name: Counter() for name in settings}
    amended: set[int] = set()
    new_tables: dict[Path, pa.Table] = {}
    for (path, table), table_rows in zip(tables.items(), rows, strict=True):
        new_table = table
        for name, value in settings.items():
            values = [row.get(name) or "" for row in table_rows]
            for index, row in enumerate(table_rows):
                if row["episode_index"] in selected and values[index] != value:
                    old_values[name][values[index]] += 1
                    amended.add(row["episode_index"])
                    values[index] = value
            if values != [row.get(name) for row in table_rows]:
                new_table = with_column(new_table, name, values, "str")
        if new_table is not table:
            new_tables[path] = new_table
    if not amended:
        raise RunError(f"{root}: expected an episode with another value, found none; nothing was changed")
    columns = {
        name: {"episodes": counts.total()}
        | ({} if name in _PERSONAL else {"from": sorted(counts), "to": settings[name]})
        for name, counts in old_values.items()
        if counts
    }
    note = {"date": today(), "episodes": len(amended), "columns": columns}
    text = record_text({**record, "amended": [*record.get("amended", []), note]})
    write_tables(new_tables, {root / RECORD_FILE: text})
    return {
        "root": str(root),
        "amended": len(amended),
        "columns": {name: counts.total() for name, counts in old_values.items()},
        "next": f'copolicy-dataset release {root} --bump patch --notes "..."; rerun check, stats and the card',
    }


def today() -> str:
    """Today's date in UTC, `YYYY-MM-DD`."""
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def _rows(tables: Any) -> list[list[dict[str, Any]]]:
    """The rows of each table, with the columns that a selection may use."""
    columns = {"episode_index", "length", *EPISODE_COLUMNS}
    return [table.select([name for name in table.column_names if name in columns]).to_pylist() for table in tables]


def _column_types(rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    types = {"episode_index": "int", "length": "int", **EPISODE_COLUMNS}
    return {name: type_name for name, type_name in types.items() if any(name in row for row in rows)}
