"""Episodes that are kept but not to be used: a flag in the data set, which training leaves out.

The flag is the episode column `discarded`, which `copolicy-train` respects, and the reason stands in the column
`quality_flags` as the entry `excluded: REASON`. Both are rows of meta/episodes, so that loading, pushing, merging
and resuming with LeRobot carry them along; a file beside them would be lost at the first merge. Nothing is removed:
`include` takes the flag away again.
"""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..command_line.commands import add_command
from ..command_line.extras import TABLES
from ..exceptions import InvalidValueError
from .episode_rows import chosen_episodes, episode_tables, with_column, write_tables

if TYPE_CHECKING:
    import pyarrow as pa

FLAG = "excluded: "
"""Begins the entry of `quality_flags` that holds the reason."""

_NEEDED = ("episode_index", "episode_uuid", "discarded", "quality_flags")


class ExcludedEpisode(NamedTuple):
    """An episode that training leaves out; `reason` is empty where its operator discarded it while recording."""

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
        return next((flag.removeprefix(FLAG) for flag in self.flags if flag.startswith(FLAG)), "")


def excluded_episodes(root: Path) -> list[ExcludedEpisode]:
    """Every episode that training leaves out, in order.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
    """
    rows = [row for table in episode_tables(root, _NEEDED).values() for row in _rows(table)]
    return sorted(ExcludedEpisode(row.episode, row.episode_uuid, row.reason) for row in rows if row.discarded)


def exclude(root: Path, episodes: Sequence[str], reason: str) -> dict[str, list[int]]:
    """Flags episodes as excluded; a new reason replaces an earlier one.

    Args:
        episodes: `12`, `3-5`, or an `episode_uuid`.
        reason: one line; commas become semicolons, because they separate flags.

    Returns:
        `excluded`, and `already_discarded` by their operator, which are left as they are.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        InvalidValueError: an episode that is not there, or no reason.
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
        return _Row(row.episode, row.episode_uuid, True, (*_without(row.flags), FLAG + reason))

    _change(root, episodes, flagged)
    return {"excluded": sorted(changed), "already_discarded": sorted(discarded)}


def include(root: Path, episodes: Sequence[str]) -> dict[str, list[int]]:
    """Takes the flag of `exclude` away; what an operator discarded stays discarded.

    Returns:
        `included`, and `not_excluded`.

    Raises:
        FileFormatError: no LeRobot data set with the episode columns.
        InvalidValueError: an episode that is not there.
    """
    changed: list[int] = []
    others: list[int] = []

    def cleared(row: _Row) -> _Row:
        if not row.reason:
            others.append(row.episode)
            return row
        changed.append(row.episode)
        return _Row(row.episode, row.episode_uuid, False, _without(row.flags))

    _change(root, episodes, cleared)
    return {"included": sorted(changed), "not_excluded": sorted(others)}


def add_exclude_command(commands: argparse._SubParsersAction) -> None:
    """Adds `exclude`."""
    parser = add_command(
        commands, "exclude", _exclude, "flag episodes that training must leave out; nothing is removed",
        'copolicy-dataset exclude datasets/table --episode-ids 12 30-33 --reason "joystick of player 1 unplugged"',
        TABLES,
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot data set")
    parser.add_argument(
        "--episode-ids", dest="episodes", nargs="+", metavar="N", help="numbers, ranges such as 3-5, or episode_uuids"
    )
    parser.add_argument("--reason", help="why, kept in the data set")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--undo", action="store_true", help="take the flag away again")
    what.add_argument("--list", action="store_true", help="print what is left out and why; change nothing")


def _exclude(arguments: argparse.Namespace) -> dict:
    if arguments.list:
        if arguments.episodes or arguments.reason:
            raise InvalidValueError("--list", "no --episode-ids and no --reason beside it", "one")
        listed = [entry._asdict() for entry in excluded_episodes(arguments.root)]
        left_out = {entry["episode"] for entry in listed}
        rest = sorted(row.episode for table in episode_tables(arguments.root, _NEEDED).values() for row in _rows(table))
        kept = ",".join(str(episode) for episode in rest if episode not in left_out)
        return {
            "left_out": listed if arguments.json else _readable(listed),
            # LeRobot's own commands and loaders take every episode unless they are told.
            "for_lerobot": f"--dataset.episodes=[{kept}]",
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


def _without(flags: Iterable[str]) -> tuple[str, ...]:
    return tuple(flag for flag in flags if not flag.startswith(FLAG))


def _change(root: Path, episodes: Sequence[str], change: Callable[[_Row], _Row]) -> None:
    """Rewrites the files of meta/episodes that hold chosen episodes."""
    tables = episode_tables(root, _NEEDED)
    everything = [row for table in tables.values() for row in _rows(table)]
    names = {row.episode_uuid: row.episode for row in everything if row.episode_uuid}
    chosen = chosen_episodes(episodes, (row.episode for row in everything), names)
    changed: dict[Path, pa.Table] = {}
    for path, table in tables.items():
        rows = _rows(table)
        after = [change(row) if row.episode in chosen else row for row in rows]
        if after != rows:
            table = with_column(table, "discarded", [row.discarded for row in after], "bool")
            changed[path] = with_column(table, "quality_flags", [",".join(row.flags) for row in after], "str")
    write_tables(changed)


def _rows(table: "pa.Table") -> list[_Row]:
    return [
        _Row(
            row["episode_index"],
            row["episode_uuid"] or "",
            bool(row["discarded"]),
            tuple(flag for flag in (row["quality_flags"] or "").split(",") if flag),
        )
        for row in table.select(_NEEDED).to_pylist()
    ]
