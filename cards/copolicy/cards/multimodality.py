"""The section of a card on how many ways the data set shows of doing the same thing."""

from .artefacts import STATISTICS_FILE, estimates, read_json
from .facts import DatasetFacts
from .markdown import number, table


def multimodality(facts: DatasetFacts) -> str:
    """Every statistic of `copolicy-dataset stats` with its interval and its null; says so where it was not run."""
    stored = read_json(facts.root / STATISTICS_FILE)
    heading = "## Multimodality"
    if stored is None:
        return f"{heading}\n\nNot computed: `copolicy-dataset stats` was not run on this data set."
    entries = estimates(stored)
    rows = [
        (
            entry["name"],
            number(entry["value"]),
            entry["unit"],
            _interval(entry.get("interval")),
            _null(entry.get("null")),
            number(entry.get("episodes")),
        )
        for entry in entries
    ]
    definitions = "\n".join(
        f"- **{entry['name']}**: {entry['definition']}{_note(entry)}" for entry in entries if entry.get("definition")
    )
    return "\n\n".join(
        (
            heading,
            f"From `{STATISTICS_FILE}`, written by `copolicy-dataset stats`.",
            table(("statistic", "value", "unit", "95 % interval", "by chance", "episodes"), rows),
            f"<details><summary>Definitions</summary>\n\n{definitions}\n\n</details>",
        )
    )


def _interval(interval: list | None) -> str:
    return "-" if not interval else f"{number(interval[0])} to {number(interval[1])}"


def _null(null: dict | None) -> str:
    if not null:
        return "-"
    return f"{number(null.get('mean'))} ({number(null.get('low'))} to {number(null.get('high'))})"


def _note(entry: dict) -> str:
    return f" ({entry['note']})" if entry.get("note") else ""
