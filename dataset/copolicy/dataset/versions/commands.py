"""`copolicy-dataset release` and `copolicy-dataset diff`."""

import argparse
from pathlib import Path
from typing import Any

from ..command_line.commands import Commands, add_command
from ..exceptions import CopolicyError, RunError

_MAX_SHOWN = 20


def add_release_command(commands: Commands) -> None:
    """Adds `release`."""
    parser = add_command(
        commands,
        "release",
        _release,
        "release the next version of a data set: writes content hash, manifest and change log",
        'copolicy-dataset release outputs/dataset --bump minor --notes "Session of pair 3"',
    )
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot v3 data set")
    parser.add_argument(
        "--bump",
        required=True,
        choices=("major", "minor", "patch"),
        help="major: features, rate or existing frames changed, or episodes were removed; minor: episodes were added "
        "or excluded; patch: metadata, card or statistics were corrected",
    )
    parser.add_argument("--notes", required=True, help="text of this release in the change log")


def add_diff_command(commands: Commands) -> None:
    """Adds `diff`."""
    parser = add_command(
        commands,
        "diff",
        _diff,
        "list the differences between two data sets; exit status 0: same, 1: different, 2: error",
        "copolicy-dataset diff outputs/dataset@1.0.0 outputs/dataset",
    )
    input_help = "folder, FOLDER@x.y.z (a release), or U/N[@REVISION] on the Hub, such as my-lab/table@data-1.0.0"
    parser.add_argument("a", metavar="A", help=input_help)
    parser.add_argument("b", metavar="B", help="data set to compare with A")


def _release(arguments: argparse.Namespace) -> dict[str, Any]:
    from .release import release

    record = release(arguments.root, arguments.bump, arguments.notes)
    return {
        "version": record.version,
        "tag": record.data_version.tag,
        "content_hash": record.content_hash,
        "episodes": len(record.content.episodes),
        "changes": record.changes,
    }


def _diff(arguments: argparse.Namespace) -> dict[str, Any]:
    from .diff_inputs import compare_statistics, read_diff_input
    from .difference import compare

    try:
        a, b = read_diff_input(arguments.a), read_diff_input(arguments.b)
    except RunError as error:
        # As in diff(1), exit status 1 means that both were read and differ.
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
    for uuid, columns in list(difference.episodes_changed.items())[:_MAX_SHOWN]:
        summary[f"episode {uuid}"] = ", ".join(columns)
    if len(difference.episodes_changed) > _MAX_SHOWN:
        summary["further episodes"] = f"{len(difference.episodes_changed) - _MAX_SHOWN} (see --json)"
    if statistics is None:
        summary["statistics"] = "not compared: not stored for both data sets"
    else:
        shown = {name: f"{before} -> {after}" for name, (before, after) in list(statistics.items())[:_MAX_SHOWN]}
        summary["statistics"] = shown or "same"
        if len(statistics) > _MAX_SHOWN:
            summary["further statistics"] = f"{len(statistics) - _MAX_SHOWN} (see --json)"
    return summary
