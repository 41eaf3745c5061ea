"""`copolicy-dataset release` and `copolicy-dataset diff`."""

import argparse
from pathlib import Path

from ..command_line.commands import add_command
from ..command_line.extras import TABLES
from ..exceptions import CopolicyError, RunError

_SHOWN = 20


def add_release_command(commands: argparse._SubParsersAction) -> None:
    """Adds `release`."""
    parser = add_command(
        commands,
        "release",
        _release,
        "give a data set its next version: content hash, manifest and change log",
        'copolicy-dataset release outputs/dataset --bump minor --notes "Session of pair 3"',
        TABLES,
    )
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot v3 data set")
    parser.add_argument(
        "--bump",
        required=True,
        choices=("major", "minor", "patch"),
        help="major: features, rate or existing frames changed, or episodes went; minor: episodes were added or "
        "excluded; patch: metadata, card or statistics were corrected",
    )
    parser.add_argument("--notes", required=True, help="what a reader should know, for the change log")


def add_diff_command(commands: argparse._SubParsersAction) -> None:
    """Adds `diff`."""
    parser = add_command(
        commands,
        "diff",
        _diff,
        "say what differs between two data sets; exit status 0 same, 1 different, 2 trouble",
        "copolicy-dataset diff outputs/dataset@1.0.0 outputs/dataset",
        TABLES,
    )
    what = "folder, FOLDER@x.y.z (a release), or U/N[@REVISION] on the Hub, such as my-lab/table@data-1.0.0"
    parser.add_argument("a", metavar="A", help=what)
    parser.add_argument("b", metavar="B", help="the same, after")


def _release(arguments: argparse.Namespace) -> dict:
    from .release import release

    record = release(arguments.root, arguments.bump, arguments.notes)
    return {
        "version": record.version,
        "tag": record.data_version.tag,
        "content_hash": record.content_hash,
        "episodes": len(record.content.episodes),
        "changes": record.changes,
    }


def _diff(arguments: argparse.Namespace) -> dict:
    from .difference import compare
    from .sources import compare_statistics, read_side

    try:
        a, b = read_side(arguments.a), read_side(arguments.b)
    except RunError as error:
        # Like diff(1): a status of 1 says that both were read and differ.
        raise CopolicyError(str(error)) from None
    difference = compare(a.content, b.content)
    summary: dict = {
        "same": difference.same,
        "content_hash": {"a": a.content_hash, "b": b.content_hash},
        "exit_status": 0,
    }
    statistics = None
    if a.statistics is not None and b.statistics is not None:
        statistics = compare_statistics(a.statistics, b.statistics)
    summary["same"] = difference.same and not statistics
    summary["exit_status"] = 0 if summary["same"] else 1
    if arguments.json:
        return {**summary, **difference.to_json(), "statistics": statistics}
    for number, change in enumerate(difference.changes):
        summary[f"change {number + 1}"] = f"{change.text} ({change.bump})"
    for uuid, columns in list(difference.episodes_changed.items())[:_SHOWN]:
        summary[f"episode {uuid}"] = ", ".join(columns)
    if len(difference.episodes_changed) > _SHOWN:
        summary["further episodes"] = f"{len(difference.episodes_changed) - _SHOWN} (see --json)"
    if statistics is None:
        summary["statistics"] = "not compared: stored on one side at most"
    else:
        shown = {name: f"{before} -> {after}" for name, (before, after) in list(statistics.items())[:_SHOWN]}
        summary["statistics"] = shown or "same"
        if len(statistics) > _SHOWN:
            summary["further statistics"] = f"{len(statistics) - _SHOWN} (see --json)"
    return summary
