"""What other commands left in a data set's `meta/` folder, when they were run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.checks.check_report import Validity, content_hash, validity
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import CHECK_FILE, RELEASE_FILE, STATISTICS_FILE
from copolicy.dataset.lerobot_folder.documents import CheckDocument, ReleaseDocument, StatisticsDocument


@dataclass(frozen=True)
class KeptFindings:
    """Findings of `copolicy-dataset check`, and whether they are about the data beside them."""

    document: dict[str, Any]
    validity: Validity


def kept_findings(root: Path, path: Path | None = None) -> KeptFindings | None:
    """The findings kept in a data set or in another file, None where there are none.

    Raises:
        FileFormatError: there is a file, and it holds no JSON object.
    """
    document = read_optional_json(path or root / CHECK_FILE, CheckDocument, "findings of copolicy-dataset check")
    if document is None:
        return None
    # Reading the whole content is worth the time only where there is something to compare it with.
    content = content_hash(root) if document.get("content_hash") else None
    return KeptFindings(document, validity(document, content))


def stored_statistics(root: Path) -> dict[str, Any] | None:
    """What `copolicy-dataset stats` stored, None where it was not run.

    Raises:
        FileFormatError: there is a file, and it holds something else.
    """
    return read_optional_json(root / STATISTICS_FILE, StatisticsDocument, "statistics of copolicy-dataset stats")


def newest_release(root: Path) -> dict[str, Any] | None:
    """What the newest release says of itself, None where there is none.

    Raises:
        FileFormatError: there is a file, and it holds something else.
    """
    return read_optional_json(root / RELEASE_FILE, ReleaseDocument, "the record of a release")


def statistics_doubt(stored: dict[str, Any], episodes: int) -> str:
    """Why stored statistics are not those of a data set with so many episodes; empty where nothing speaks for it."""
    described = stored.get("dataset", {})
    if "episodes" not in described:
        return ""
    counted = described["episodes"] + sum(described.get("left_out", {}).values())
    if counted == episodes:
        return ""
    return f"They were computed when the data set had {counted} episodes; it has {episodes} now."


def estimates(node: Any, path: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """The statistics in a JSON tree: every object with a value and a unit, named by where it lies.

    What an estimate is made of (`details`) is left out.
    """
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
