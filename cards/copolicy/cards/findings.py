"""The section of a card on what a check found, and whether that still holds."""

from collections import Counter

from copolicy.dataset.files.meta_files import CHECK_FILE

from .artefacts import kept_findings
from .facts import DatasetFacts
from .markdown import number, table

_HEADING = "## Checks"
_SEVERITIES: tuple[object, ...] = ("error", "warning", "info")


def findings(facts: DatasetFacts) -> str:
    """Counts and rules of the findings that `copolicy-dataset check` kept; says so where there are none."""
    kept = kept_findings(facts.root)
    if kept is None:
        return f"{_HEADING}\n\nNot checked: `copolicy-dataset check` was not run on this data set."
    document = kept.document
    found = [entry for entry in document.get("findings", []) if isinstance(entry, dict)]
    counts = Counter(entry.get("severity") for entry in found)
    when = f" on {document['date'][:10]}" if "date" in document else ""
    rules = f" by version {document['rules_version']} of the rules" if "rules_version" in document else ""
    lines = [
        _HEADING,
        f"Checked{when}{rules} (`{CHECK_FILE}`): {counts['error']} errors, {counts['warning']} warnings, "
        f"{counts['info']} remarks.",
    ]
    if kept.validity.state != "current":
        lines.insert(1, f"**{kept.validity.state.capitalize()}.** {kept.validity.reason}")
    groups = Counter((entry.get("severity"), entry.get("rule")) for entry in found)
    if groups:
        first = {(entry.get("severity"), entry.get("rule")): entry for entry in reversed(found)}
        ordered = sorted(groups, key=lambda group: (_rank(group[0]), -groups[group]))
        rows = [
            (severity, str(rule).replace("_", " "), groups[severity, rule], _example(first[severity, rule]))
            for severity, rule in ordered
        ]
        lines.append(table(("severity", "rule", "findings", "the first"), rows))
    return "\n\n".join(lines)


def _rank(severity: object) -> int:
    return _SEVERITIES.index(severity) if severity in _SEVERITIES else len(_SEVERITIES)


def _example(entry: dict) -> str:
    place = f"episode {entry['episode']}: " if entry.get("episode") else ""
    figures = "" if entry.get("figure") is None else f" ({number(entry['figure'])}; limit {number(entry.get('limit'))})"
    return f"{place}{entry.get('message', '')}{figures}"
