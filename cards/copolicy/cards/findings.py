"""The section of a card on the findings of `copolicy-dataset check`."""

from collections import Counter

from copolicy.dataset.files.meta_files import CHECK_FILE

from .artefacts import stored_findings
from .facts import DatasetFacts
from .formatting import format_number, table

_HEADING = "## Checks"
_SEVERITIES: tuple[object, ...] = ("error", "warning", "info")


def findings(facts: DatasetFacts) -> str:
    """Counts and rules of the stored findings, or a sentence that the check was not run."""
    stored = stored_findings(facts.root)
    if stored is None:
        return f"{_HEADING}\n\nNot checked: `copolicy-dataset check` was not run on this data set."
    document = stored.document
    entries = [entry for entry in document.get("findings", []) if isinstance(entry, dict)]
    counts = Counter(entry.get("severity") for entry in entries)
    date = f" on {document['date'][:10]}" if "date" in document else ""
    rules = f" by version {document['rules_version']} of the rules" if "rules_version" in document else ""
    lines = [
        _HEADING,
        f"Checked{date}{rules} (`{CHECK_FILE}`): {counts['error']} errors, {counts['warning']} warnings, "
        f"{counts['info']} remarks.",
    ]
    if stored.validity.state != "current":
        lines.insert(1, f"**{stored.validity.state.capitalize()}.** {stored.validity.reason}")
    groups = Counter((entry.get("severity"), entry.get("rule")) for entry in entries)
    if groups:
        first = {(entry.get("severity"), entry.get("rule")): entry for entry in reversed(entries)}
        ordered = sorted(groups, key=lambda group: (_rank(group[0]), -groups[group]))
        rows = [
            (severity, str(rule).replace("_", " "), groups[severity, rule], _example(first[severity, rule]))
            for severity, rule in ordered
        ]
        lines.append(table(("severity", "rule", "findings", "first finding"), rows))
    return "\n\n".join(lines)


def _rank(severity: object) -> int:
    return _SEVERITIES.index(severity) if severity in _SEVERITIES else len(_SEVERITIES)


def _example(entry: dict) -> str:
    episode = f"episode {entry['episode']}: " if entry.get("episode") else ""
    figure, limit = (format_number(entry.get(name)) for name in ("figure", "limit"))
    figures = "" if entry.get("figure") is None else f" ({figure}; limit {limit})"
    return f"{episode}{entry.get('message', '')}{figures}"
