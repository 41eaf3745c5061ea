"""Reads the files that other commands write to a data set's `meta/` folder: findings, statistics, release."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.checks.check_report import Validity, content_hash, validity
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import CHECK_FILE, RELEASE_FILE, STATISTICS_FILE
from copolicy.dataset.lerobot_folder.documents import CheckDocument, ReleaseDocument, StatisticsDocument


@dataclass(frozen=True)
class StoredFindings:
    """Findings of `copolicy-dataset check`, and whether they still hold for the data set."""

    document: dict[str, Any]
    validity: Validity


def stored_findings(root: Path, path: Path | None = None) -> StoredFindings | None:
    """Reads the findings stored in a data set or in another file, None if there are none.

    Raises:
        FileFormatError: the file holds no JSON object.
    """
    document = read_optional_json(path or root / CHECK_FILE, CheckDocument, "findings of copolicy-dataset check")
    if document is None:
        return None
    # Hashing the content takes long: only done if the findings state a hash to compare with.
    content = content_hash(root) if document.get("content_hash") else None
    return StoredFindings(document, validity(document, content))


def stored_statistics(root: Path) -> dict[str, Any] | None:
    """Reads the output of `copolicy-dataset stats`, None if there is none.

    Raises:
        FileFormatError: the file holds something else.
    """
    return read_optional_json(root / STATISTICS_FILE, StatisticsDocument, "statistics of copolicy-dataset stats")


def newest_release(root: Path) -> dict[str, Any] | None:
    """Reads the record of the newest release, None if there is none.

    Raises:
        FileFormatError: the file holds something else.
    """
    return read_optional_json(root / RELEASE_FILE, ReleaseDocument, "the record of a release")


def stale_statistics_reason(stored: dict[str, Any], episodes: int) -> str:
    """States why stored statistics do not describe a data set with this number of episodes; empty if they may."""
    described = stored.get("dataset", {})
    if "episodes" not in described:
        return ""
    counted = described["episodes"] + sum(described.get("left_out", {}).values())
    if counted == episodes:
        return ""
    return f"They were computed when the data set had {counted} episodes; it has {episodes} now."


def estimates(node: Any, path: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """Lists the statistics in a JSON tree: objects with a value and a unit, without `details`, named by their path."""
    if not isinstance(node, dict):
        return []
    if "value" in node and "unit" in node:
        entry = {key: value for key, value in node.items() if key != "details"}
        return [{"name": ": ".join(path).replace("_", " "), **entry}]
    return [
        entry
        for key, child in node.items()
        for entry in estimates(child, path if key == "statistics" else (*path, str(key)))
    ]
