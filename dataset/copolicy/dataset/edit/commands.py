"""`copolicy-dataset select`, `split`, `withdraw` and `amend`."""

import argparse
from pathlib import Path
from typing import Any

from ..command_line.commands import Commands, add_command
from ..command_line.flag_numbers import seed
from ..exceptions import InvalidValueError

_ROOT = "folder of a LeRobot data set"


def add_select_command(commands: Commands) -> None:
    """Adds `select`."""
    parser = add_command(
        commands, "select", _select, "copy selected episodes to a new data set",
        "copolicy-dataset select datasets/table --out datasets/short --pair-ids P03 P07 "
        "--where 'duration_s < 20 and source == \"human\"'",
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help=_ROOT)
    parser.add_argument("--out", type=Path, required=True, metavar="NEW", help="new folder; must not exist")
    _add_selection_flags(parser)
    parser.add_argument("--drop-excluded", action="store_true", help="leave out discarded and excluded episodes")


def add_split_command(commands: Commands) -> None:
    """Adds `split`."""
    parser = add_command(
        commands, "split", _split, "split a data set into parts that share no person or no map",
        "copolicy-dataset split datasets/table --out datasets/parts --parts train=0.8 valid=0.1 test=0.1\n"
        "  copolicy-dataset split datasets/table --out datasets/parts --by pairs --parts test=P03,P07 train=rest",
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help=_ROOT)
    parser.add_argument("--out", type=Path, required=True, metavar="NEW", help="new folder of parts; must not exist")
    parser.add_argument(
        "--parts", nargs="+", required=True, metavar="NAME=VALUE",
        help="a proportion (train=0.8), pairs or maps (test=P03,P07), or rest for all others",
    )  # fmt: skip
    parser.add_argument(
        "--by", choices=("pairs", "maps", "episodes"), default="pairs",
        help="unit that is never in two parts: a pair and all partners of its players (default); a map in all its "
        "start orientations; or a single episode",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed(), default=0, help="seed of the order of groups of equal size")
    parser.add_argument(
        "--same-consent", action="store_true", help="treat a consent id in two pairs as the same person (--by pairs)"
    )
    parser.add_argument("--drop-excluded", action="store_true", help="leave out discarded and excluded episodes")
    parser.add_argument(
        "--as-splits", action="store_true",
        help="write one data set with the parts as splits of meta/info.json",
    )  # fmt: skip


def add_withdraw_command(commands: Commands) -> None:
    """Adds `withdraw`."""
    parser = add_command(
        commands, "withdraw", _withdraw, "delete all episodes of a consent id from recordings and data sets",
        "copolicy-dataset withdraw C-17 recordings datasets/table        (lists what would be deleted)\n"
        "  copolicy-dataset withdraw C-17 recordings datasets/table --yes",
    )  # fmt: skip
    parser.add_argument("consent", metavar="CONSENT_ID", help="one consent id")
    parser.add_argument("paths", nargs="+", type=Path, metavar="PATH", help="folders of recordings and data sets")
    parser.add_argument("--yes", action="store_true", help="delete; without this flag nothing is changed")


def add_amend_command(commands: Commands) -> None:
    """Adds `amend`."""
    parser = add_command(
        commands, "amend", _amend, "correct declared episode columns in place, or restore lost ones",
        "copolicy-dataset amend datasets/table --set license=cc-by-4.0\n"
        "  copolicy-dataset amend datasets/table --set consent_id=C-12 --episode-ids 3-5\n"
        "  copolicy-dataset amend datasets/table --restore-from recordings",
    )  # fmt: skip
    parser.add_argument("root", type=Path, metavar="PATH", help=_ROOT)
    mode = parser.add_mutually_exclusive_group(required=True)
    mode.add_argument(
        "--set", nargs="+", metavar="NAME=VALUE", dest="settings",
        help="declared columns: license, consent_id, session_id, pair_id, player_0_id, player_1_id, controller_0, "
        "controller_1, map_set, source; in all episodes, or those selected by the other flags",
    )  # fmt: skip
    mode.add_argument(
        "--restore-from", type=Path, metavar="PATH",
        help="restore the columns that LeRobot's delete and split drop, from recordings or an earlier version",
    )  # fmt: skip
    _add_selection_flags(parser)


def _add_selection_flags(parser: argparse.ArgumentParser) -> None:
    """Adds the flags that select episodes: values of one flag are alternatives, several flags are combined by and."""
    for flag, dest, metavar, text in (
        ("--episode-ids", "episodes", "N", "numbers, ranges such as 3-5, or episode_uuids"),
        ("--pair-ids", "pairs", "ID", "pseudonyms of pairs"),
        ("--player-ids", "players", "ID", "player ids, at either seat"),
        ("--consent-ids", "consents", "ID", "consent ids; an episode may have one for each player"),
        ("--map-sets", "map_sets", "NAME", "map sets"),
        ("--map-ids", "map_ids", "ID", "maps"),
        ("--results", "results", "RESULT", "success, failure, or a termination reason such as goal or timeout"),
        ("--sources", "sources", "SOURCE", "human, simulated or upstream"),
    ):
        parser.add_argument(flag, dest=dest, nargs="+", default=(), metavar=metavar, help=text)
    parser.add_argument("--where", default="", metavar="CONDITION", help="condition on episode columns")


def _selection(arguments: argparse.Namespace):
    from .selection import Selection

    names = ("episodes", "pairs", "players", "consents", "map_sets", "map_ids", "results", "sources")
    values = {name: tuple(getattr(arguments, name)) for name in names}
    return Selection(**values, where=arguments.where, drop_excluded=getattr(arguments, "drop_excluded", False))


def _select(arguments: argparse.Namespace) -> dict[str, Any]:
    from .select import select

    selection = _selection(arguments)
    if not selection.criteria():
        raise InvalidValueError("select", "at least one of --episode-ids, --pair-ids, ..., --drop-excluded", "none")
    return select(arguments.root, arguments.out, selection)


def _split(arguments: argparse.Namespace) -> dict[str, Any]:
    from .parts import parse_parts
    from .split import split

    parts = parse_parts(arguments.parts)
    if arguments.same_consent and arguments.by != "pairs":
        raise InvalidValueError("--same-consent", "--by pairs with it", arguments.by)
    return split(
        arguments.root,
        arguments.out,
        parts,
        arguments.by,
        arguments.seed,
        arguments.drop_excluded,
        arguments.same_consent,
        arguments.as_splits,
    )


def _withdraw(arguments: argparse.Namespace) -> dict[str, Any]:
    from .withdrawal.withdraw import withdraw

    return withdraw(arguments.consent, arguments.paths, arguments.yes)


def _amend(arguments: argparse.Namespace) -> dict[str, Any]:
    selection = _selection(arguments)
    if arguments.restore_from is not None:
        if criteria := selection.criteria():
            raise InvalidValueError("--restore-from", "no other flag with it", next(iter(criteria)))
        from .restore import restore

        return restore(arguments.root, arguments.restore_from)
    from .amend import amend, parse_settings

    return amend(arguments.root, parse_settings(arguments.settings), selection if selection.criteria() else None)
