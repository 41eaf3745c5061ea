"""The findings of a check as they are kept in a data set, `meta/copolicy_check.json`, and whether they still hold.

The file describes the data and is no part of them: the content hash leaves it out, a release may be checked again
without a new version, and neither a manifest nor the checks themselves call its renewal a change. It names the
content that was checked, so that a reader sees when the data went on without it.
"""

import datetime
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from ..exceptions import CopolicyError
from .finding import SEVERITIES
from .limits import RULES_VERSION, limits_of
from .result import CheckResult

SCHEMA = "copolicy-check-1"

State = Literal["current", "stale", "unknown"]


@dataclass(frozen=True)
class Validity:
    """Whether kept findings are about the data beside them.

    Attributes:
        state: `current`; `stale` where the content, the rules or their limits changed since; `unknown` where that
            cannot be told.
        reason: why, in one sentence; empty for `current`.
    """

    state: State
    reason: str = ""


def check_document(
    result: CheckResult, content: str | None, strict: bool = False, date: datetime.datetime | None = None
) -> dict[str, Any]:
    """What `copolicy-dataset check` prints as JSON and keeps.

    Args:
        content: content hash of what was checked; None where there is none, as for recordings or a damaged data set.
        strict: whether a warning fails, too.
        date: of the check; now by default.
    """
    moment = (date or datetime.datetime.now(datetime.UTC)).astimezone(datetime.UTC)
    return {
        "schema": SCHEMA,
        "rules_version": RULES_VERSION,
        "software_version": version("lerobot_policy_copolicy"),
        "date": moment.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "content_hash": content,
        "kind": result.table.kind,
        "episodes": len(result.table.labels),
        "frames": result.table.frame_count,
        "rules": len(result.applied),
        "applied": list(result.applied),
        "not_applied": result.not_applied,
        "limits": {name: asdict(limit) for name, limit in limits_of(result.table.task).items()},
        "counts": {severity: result.count(severity) for severity in SEVERITIES},
        "strict": strict,
        "passed": not result.failed(strict),
        "findings": [finding.to_dict() for finding in result.findings],
    }


def content_hash(root: Path) -> str | None:
    """The content hash of a data set, None where its files cannot be read as one."""
    from ..versions.content import read_content

    try:
        return read_content(root).hash
    except CopolicyError:
        return None


def validity(document: Mapping[str, Any], content: str | None) -> Validity:
    """Whether findings still hold.

    Args:
        document: what was kept; the output of an earlier `check --json` has neither content hash nor version.
        content: content hash of the data set as it is now (`content_hash`).
    """
    checked = document.get("content_hash")
    if "rules_version" not in document:
        return Validity("unknown", "They do not say which content was checked: the data may have changed since.")
    if checked is None:
        return Validity("unknown", "The content could not be read when it was checked, so it cannot be compared.")
    if content is None:
        return Validity("unknown", "The content cannot be read now, so it cannot be compared with what was checked.")
    if checked != content:
        return Validity("stale", "The content of the data set changed since it was checked.")
    if document["rules_version"] != RULES_VERSION:
        found = f"They were made by version {document['rules_version']} of the rules; these are {RULES_VERSION}."
        return Validity("stale", found)
    return Validity("current")
