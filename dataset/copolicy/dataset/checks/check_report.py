"""The check report of a data set, `meta/copolicy_check.json`, and whether it is up to date.

The check report is metadata: the content hash excludes it, and writing it again changes neither a release nor its
manifest. It contains the content hash of the checked data, by which readers detect later changes of the data.
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
    """Whether a check report describes the current data.

    Attributes:
        state: `current`; `stale` if the content or the rules changed since the check; `unknown` if that cannot be
            determined.
        reason: reason in one sentence; empty for `current`.
    """

    state: State
    reason: str = ""


def check_document(
    result: CheckResult, content: str | None, strict: bool = False, date: datetime.datetime | None = None
) -> dict[str, Any]:
    """The check report, which `copolicy-dataset check` writes and prints as JSON.

    Args:
        content: content hash of the checked data; None for recordings or a damaged data set.
        strict: whether warnings count as failures.
        date: date of the check; now by default.
    """
    moment = (date or datetime.datetime.now(datetime.UTC)).astimezone(datetime.UTC)
    return {
        "schema": SCHEMA,
        "rules_version": RULES_VERSION,
        "software_version": version("lerobot_policy_copolicy"),
        "date": moment.strftime("%Y-%m-%dT%H:%M:%SZ"),
        "content_hash": content,
        "kind": result.data.kind,
        "episodes": len(result.data.labels),
        "frames": result.data.frame_count,
        "rules": len(result.applied),
        "applied": list(result.applied),
        "not_applied": result.not_applied,
        "limits": {name: asdict(limit) for name, limit in limits_of(result.data.task).items()},
        "counts": {severity: result.count(severity) for severity in SEVERITIES},
        "strict": strict,
        "passed": not result.failed(strict),
        "findings": [finding.to_dict() for finding in result.findings],
    }


def content_hash(root: Path) -> str | None:
    """The content hash of a data set; None if it cannot be read."""
    from ..versions.content import read_content

    try:
        return read_content(root).hash
    except CopolicyError:
        return None


def validity(document: Mapping[str, Any], content: str | None) -> Validity:
    """Whether a check report is up to date.

    Args:
        document: the check report; early versions have neither content hash nor rules version.
        content: current content hash of the data set (`content_hash`).
    """
    checked_hash = document.get("content_hash")
    if "rules_version" not in document:
        return Validity("unknown", "They do not say which content was checked: the data may have changed since.")
    if checked_hash is None:
        return Validity("unknown", "The content could not be read when it was checked, so it cannot be compared.")
    if content is None:
        return Validity("unknown", "The content cannot be read now, so it cannot be compared with what was checked.")
    if checked_hash != content:
        return Validity("stale", "The content of the data set changed since it was checked.")
    if document["rules_version"] != RULES_VERSION:
        reason = f"They were made by version {document['rules_version']} of the rules; these are {RULES_VERSION}."
        return Validity("stale", reason)
    return Validity("current")
