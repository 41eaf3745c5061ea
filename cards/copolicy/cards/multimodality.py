"""The section of a card on how many ways the data set shows of doing the same thing."""

from collections import defaultdict
from typing import Any

from copolicy.dataset.files.meta_files import STATISTICS_FILE

from .artefacts import estimates, statistics_doubt, stored_statistics
from .facts import DatasetFacts
from .markdown import number, table
from .routes import RouteStatistics, route_statistics


def multimodality(facts: DatasetFacts) -> str:
    """Every statistic of `copolicy-dataset stats` with its interval and its null; says so where it was not run."""
    stored = stored_statistics(facts.root)
    heading = "## Multimodality"
    if stored is None:
        return f"{heading}\n\nNot computed: `copolicy-dataset stats` was not run on this data set."
    entries, lacking = [], defaultdict(list)
    for entry in estimates(stored):
        if (note := str(entry.get("note") or "")).startswith("left out:"):
            lacking[note].append(entry["name"])
        else:
            entries.append(entry)
    absent = ["\n".join(f"- {', '.join(names)}: {note}" for note, names in lacking.items())] if lacking else []
    rows = [
        (entry["name"], number(entry["value"]), entry["unit"], _interval(entry.get("interval")),
         _null(entry.get("null")), number(entry.get("episodes")))
        for entry in entries
    ]  # fmt: skip
    definitions = "\n".join(
        f"- **{entry['name']}**: {entry['definition']}{_note(entry)}" for entry in entries if entry.get("definition")
    )
    return "\n\n".join(
        (
            heading,
            *_origin(stored, facts),
            table(("statistic", "value", "unit", "95 % interval", "by chance", "episodes"), rows),
            *absent,
            *_routes(route_statistics(stored)),
            f"<details><summary>Definitions</summary>\n\n{definitions}\n\n</details>",
        )
    )


def _origin(stored: dict[str, Any], facts: DatasetFacts) -> list[str]:
    version = stored.get("definition_version")
    which = f" by version {version} of the definitions" if version else ""
    doubt = statistics_doubt(stored, len(facts.episodes))
    return [
        *([f"**Stale.** {doubt}"] if doubt else []),
        f"From `{STATISTICS_FILE}`, written by `copolicy-dataset stats`{which}.",
    ]


def _routes(routes: RouteStatistics | None) -> list[str]:
    """Entropy of each configuration, folded away: there may be dozens."""
    if routes is None or not routes.configurations:
        return []
    between = "95 % interval"
    heads = ("configuration", "episodes", "routes", "entropy, bits", between, "effective modes", between)
    rows = [
        (entry["name"], entry["episodes"], ", ".join(f"{word} {count}" for word, count in entry["counts"].items()),
         number(entry.get("entropy_bits")), _interval(entry.get("interval")),
         number(entry.get("effective_modes")), _interval(entry.get("effective_modes_interval")))
        for entry in routes.configurations
    ]  # fmt: skip
    title = f"Routes of {routes.played_by} in each of {len(rows)} configurations"
    return [f"<details><summary>{title}</summary>\n\n{table(heads, rows)}\n\n</details>"]


def _interval(interval: list | None) -> str:
    return "-" if not interval else f"{number(interval[0])} to {number(interval[1])}"


def _null(null: dict | None) -> str:
    if not null:
        return "-"
    return f"{number(null.get('mean'))} ({number(null.get('low'))} to {number(null.get('high'))})"


def _note(entry: dict) -> str:
    return f" ({entry['note']})" if entry.get("note") else ""
