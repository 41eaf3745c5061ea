"""Excludes episodes from training by a flag in the data set, and includes them again; no episode is removed.

The flag is the episode column `discarded`, which `copolicy-train` respects; the reason is the entry
`excluded: REASON` of the column `quality_flags`. Both are columns of meta/episodes, so LeRobot's loading, pushing,
merging and resuming keep them; a separate file would be lost at the first merge.
"""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..command_line.commands import Commands, add_command
from ..exceptions import InvalidValueError
from .episode_rows import episode_tables, select_episodes, with_column, write_tables

if TYPE_CHECKING:
    import pyarrow as pa

EXCLUDED_PREFIX = "excluded: "
"""Prefix of the entry of `quality_flags` with the reason."""

_COLUMNS = ("episode_index", "episode_uuid", "discarded", "quality_flags")


class ExcludedEpisode(NamedTuple):
    """An episode that training leaves out; `reason` is empty if it was discarded while recording."""

    episode: int
    episode_uuid: str
    reason: str


@dataclass(frozen=True)
class _Row:
    episode: int
    episode_uuid: str
    discarded: bool
    flags: tuple[str, ...]

    @property
    def reason(self) -> str:
        return next((flag.removeprefix(EXCLUDED_PREFIX) for flag in self.flags if flag.startswith(EXCLUDED_PREFIX)), "")


def excluded_episodes(root: Path) -> list[ExcludedEpisode]:
    """Lists the episodes that training leaves out, in order.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
    """
    rows = [row for table in episode_tables(root, _COLUMNS).values() for row in _rows(table)]
    return sorted(ExcludedEpisode(row.episode, row.episode_uuid, row.reason) for row in rows if row.discarded)


def exclude(root: Path, episodes: Sequence[str], reason: str) -> dict[str, list[int]]:
    """Flags episodes as excluded; a new reason replaces an earlier one.

    Args:
        episodes: `12`, `3-5`, or an `episode_uuid`.
        reason: one line; commas become semicolons, because they separate flags.

    Returns:
        Episode numbers: `excluded`, and `already_discarded` while recording, which stay unchanged.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        InvalidValueError: no such episode, or no reason.
    """
    reason = " ".join(reason.replace(",", ";").split())
    if not reason:
        raise InvalidValueError("--reason", "why the episodes are excluded", reason)
    changed: list[int] = []
    discarded: list[int] = []

    def flagged(row: _Row) -> _Row:
        if row.discarded and not row.reason:
            discarded.append(row.episode)
            return row
        changed.append(row.episode)
        return _Row(row.episode, row.episode_uuid, True, (*_without_reason(row.flags), EXCLUDED_PREFIX + reason))

    _rewrite_rows(root, episodes, flagged)
    return {"excluded": sorted(changed), "already_discarded": sorted(discarded)}


def include(root: Path, episodes: Sequence[str]) -> dict[str, list[int]]:
    """Removes the flag of `exclude`; episodes discarded while recording stay discarded.

    Returns:
        The episode numbers under `included` and `not_excluded`.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        InvalidValueError: no such episode.
    """
    changed: list[int] = []
    not_excluded: list[int] = []

    def cleared(row: _Row) -> _Row:
        if not row.reason:
            not_excluded.append(row.episode)
            return row
        changed.append(row.episode)
        return _Row(row.episode, row.episode_uuid, False, _without_reason(row.flags))

    _rewrite_rows(root, episodes, cleared)
    return {"included": sorted(changed), "not_excluded": sorted(not_excluded)}


def add_exclude_command(commands: Commands) -> None:
    """Adds `exclude`."""
    parser = add_command(
        commands, "exclude", _exclude, "exclude episodes from training by a flag; no episode is removed",
        'copolicy-dataset exclude datasets/table --episode-ids 12 30-33 --reason "joystick of player 1 unplugged"',
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot data set")
    parser.add_argument(
        "--episode-ids", dest="episodes", nargs="+", metavar="N", help="numbers, ranges such as 3-5, or episode_uuids"
    )
    parser.add_argument("--reason", help="reason, stored in the data set")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--undo", action="store_true", help="remove the flag")
    mode.add_argument("--list", action="store_true", help="list excluded episodes and their reasons; change nothing")


def _exclude(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.list:
        if arguments.episodes or arguments.reason:
            raise InvalidValueError("--list", "neither --episode-ids nor --reason with it", "one")
        listed = [entry._asdict() for entry in excluded_episodes(arguments.root)]
        left_out = {entry["episode"] for entry in listed}
        rows = [row for table in episode_tables(arguments.root, _COLUMNS).values() for row in _rows(table)]
        included = ",".join(
            str(row.episode) for row in sorted(rows, key=lambda row: row.episode) if row.episode not in left_out
        )
        return {
            "left_out": listed if arguments.json else _readable(listed),
            # LeRobot's commands and loaders use every episode unless this flag lists them.
            "for_lerobot": f"--dataset.episodes=[{included}]",
        }
    if not arguments.episodes:
        raise InvalidValueError("--episode-ids", "numbers, ranges such as 3-5, or episode_uuids", None)
    if arguments.undo:
        if arguments.reason:
            raise InvalidValueError("--reason", "none with --undo", arguments.reason)
        return {"root": str(arguments.root), **include(arguments.root, arguments.episodes)}
    return {"root": str(arguments.root), **exclude(arguments.root, arguments.episodes, arguments.reason or "")}


def _readable(listed: list[dict]) -> dict[str, str]:
    return {f"episode {entry['episode']}": entry["reason"] or "discarded while recording" for entry in listed}


def _without_reason(flags: Iterable[str]) -> tuple[str, ...]:
    return tuple(flag for flag in flags if not flag.startswith(EXCLUDED_PREFIX))


def _rewrite_rows(root: Path, episodes: Sequence[str], change: Callable[[_Row], _Row]) -> None:
    """Applies `change` to the rows of the chosen episodes and rewrites their files."""
    tables = episode_tables(root, _COLUMNS)
    all_rows = [row for table in tables.values() for row in _rows(table)]
    numbers_by_uuid = {row.episode_uuid: row.episode for row in all_rows if row.episode_uuid}
    chosen = select_episodes(episodes, (row.episode for row in all_rows), numbers_by_uuid)
    changed: dict[Path, pa.Table] = {}
    for path, table in tables.items():
        rows = _rows(table)
        new_rows = [change(row) if row.episode in chosen else row for row in rows]
        if new_rows != rows:
            table = with_column(table, "discarded", [row.discarded for row in new_rows], "bool")
            changed[path] = with_column(table, "quality_flags", [",".join(row.flags) for row in new_rows], "str")
    write_tables(changed)


def _rows(table: "pa.Table") -> list[_Row]:
    return [
        _Row(
            row["episode_index"],
            row["episode_uuid"] or "",
            bool(row["discarded"]),
            tuple(flag for flag in (row["quality_flags"] or "").split(",") if flag),
        )
        for row in table.select(_COLUMNS).to_pylist()
    ]
