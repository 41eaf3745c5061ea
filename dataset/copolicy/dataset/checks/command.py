"""`copolicy-dataset check`."""

import argparse
import logging
import sys
from pathlib import Path
from typing import Any

from ..command_line.commands import Commands, add_command
from ..exceptions import InvalidValueError
from ..files.meta_files import CHECK_FILE
from ..files.staging import replace_json
from ..hub.local_copy import local_copy
from ..task import TABLE, get_task
from .check_report import check_document, content_hash
from .limits import limits_of
from .result import CheckResult

_EXAMPLE = """copolicy-dataset check recordings/session-1
  copolicy-dataset check datasets/train --against datasets/test --strict
  copolicy-dataset check my-lab/table --revision data-1.0.0 --json"""
_SHOWN = ("kind", "episodes", "frames", "rules", "not_applied", "counts")


def add_check_command(commands: Commands) -> None:
    """Adds `check`."""
    parser = add_command(
        commands, "check", _check, "check recordings or a data set against rules; changes no data", _EXAMPLE,
    )  # fmt: skip
    parser.add_argument(
        "path", nargs="?", metavar="PATH", help="folder of recordings, data set, or USER/NAME on the Hub"
    )
    parser.add_argument("--revision", help="tag, branch or commit on the Hub")
    parser.add_argument("--against", metavar="PATH", help="data that must not share an episode with PATH")
    parser.add_argument("--strict", action="store_true", help="exit with status 1 for warnings, too")
    parser.add_argument(
        "--save",
        action=argparse.BooleanOptionalAction,
        default=True,
        help=f"write the findings into the data set folder, as {CHECK_FILE} (default: yes)",
    )
    parser.add_argument("--rules", action="store_true", help="print every limit with its reason; check nothing")
    parser.add_argument(
        "--task", default=TABLE, metavar="NAME", help="task whose rules --rules prints (default: %(default)s)"
    )


def _check(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.rules:
        return {
            name: f"{limit.value:g} {limit.unit}: {limit.reason}"
            for name, limit in limits_of(get_task(arguments.task)).items()
        }
    if arguments.path is None:
        raise InvalidValueError("PATH", "a folder, or USER/NAME of a data set on the Hub", None)
    from .checking import add_leaks, check_dataset  # imports scipy, not needed for `--help`

    root = local_copy(arguments.path, arguments.revision, ("PATH", "--revision"))
    against = None if arguments.against is None else local_copy(arguments.against)
    own_result = check_dataset(root)
    # Findings of a data set on the Hub are not written into the client's cache.
    save = arguments.save and own_result.data.kind == "lerobot" and Path(arguments.path).exists()
    content = content_hash(root) if own_result.data.kind == "lerobot" and (save or arguments.json) else None
    saved = _save(root, check_document(own_result, content)) if save else None
    result = own_result if against is None else add_leaks(own_result, root, against)
    document = check_document(result, content, arguments.strict)
    return _summary(arguments, result, document, saved)


def _save(root: Path, document: dict[str, Any]) -> str | None:
    """Writes the check report into the data set; returns its path, or None with a warning if that fails."""
    try:
        replace_json(root / CHECK_FILE, document, allow_nan=False)
    except OSError as error:
        reason = error.strerror or str(error)
        message = "warning: %s: the findings were not written: %s; --no-save does not try"
        logging.warning(message, root / CHECK_FILE, reason)
        return None
    return str(root / CHECK_FILE)


def _summary(
    arguments: argparse.Namespace, result: CheckResult, document: dict[str, Any], saved: str | None
) -> dict[str, Any]:
    path = {"path": str(Path(arguments.path))}
    status = {"exit_status": int(not document["passed"])}
    if arguments.json:
        return {**path, "saved": saved, **document, **status}
    for finding in result.findings:
        print(finding)
    sys.stdout.flush()
    saved_entry = {} if saved is None else {"saved": saved}
    return {**path, **{name: document[name] for name in _SHOWN}, **saved_entry, "passed": document["passed"], **status}
