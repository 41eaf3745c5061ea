"""`copolicy-dataset check`."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ..commandline import add_command
from ..exceptions import InvalidValueError
from .finding import SEVERITIES
from .limits import LIMITS
from .location import locate

if TYPE_CHECKING:
    from .checking import CheckResult

_EXAMPLE = """copolicy-dataset check recordings/session-1
  copolicy-dataset check datasets/train --against datasets/test --strict
  copolicy-dataset check my-lab/table --revision data-1.0.0 --json"""


def add_check_command(commands: argparse._SubParsersAction) -> None:
    """Adds `check`."""
    parser = add_command(
        commands, "check", _check, "look for what is wrong with recordings or a data set; repairs nothing", _EXAMPLE
    )
    parser.add_argument(
        "path", nargs="?", metavar="PATH", help="folder of recordings, data set, or USER/NAME on the Hub"
    )
    parser.add_argument("--revision", help="tag, branch or commit on the Hub")
    parser.add_argument("--against", metavar="PATH", help="data that must share no episode with PATH")
    parser.add_argument("--strict", action="store_true", help="warnings, too, give exit status 1")
    parser.add_argument("--rules", action="store_true", help="print every limit with its reason, and check nothing")


def _check(arguments: argparse.Namespace) -> dict:
    if arguments.rules:
        return {name: f"{one.value:g} {one.unit}: {one.reason}" for name, one in LIMITS.items()}
    if arguments.path is None:
        raise InvalidValueError("PATH", "a folder, or USER/NAME of a data set on the Hub", None)
    from .checking import check_dataset  # scipy, which `--help` need not wait for

    root = locate(arguments.path, arguments.revision)
    against = None if arguments.against is None else locate(arguments.against)
    result = check_dataset(root, against)
    summary = _summary(result, arguments.path, arguments.strict)
    if arguments.json:
        summary["findings"] = [finding.to_dict() for finding in result.findings]
    else:
        for finding in result.findings:
            print(finding)
        sys.stdout.flush()
    return summary


def _summary(result: "CheckResult", path: str, strict: bool) -> dict:
    failed = result.failed(strict)
    return {
        "path": str(Path(path)),
        "kind": result.table.kind,
        "episodes": len(result.table.labels),
        "frames": result.table.frame_count,
        "rules": len(result.applied),
        "not_applied": result.not_applied,
        "counts": {severity: result.count(severity) for severity in SEVERITIES},
        "passed": not failed,
        "exit_status": int(failed),
    }
