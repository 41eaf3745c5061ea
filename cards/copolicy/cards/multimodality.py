"""The section of a card on the multimodality statistics of a data set."""

from collections import defaultdict
from typing import Any

from copolicy.dataset.files.meta_files import STATISTICS_FILE

from .artefacts import estimates, stale_statistics_reason, stored_statistics
from .facts import DatasetFacts
from .formatting import format_number, table
from .route_statistics import RouteStatistics, route_statistics


def multimodality(facts: DatasetFacts) -> str:
    """Renders the output of `copolicy-dataset stats`, with intervals and null distributions."""
    stored = stored_statistics(facts.root)
    heading = "## Multimodality"
    if stored is None:
        return f"{heading}\n\nNot computed: `copolicy-dataset stats` was not run on this data set."
    entries, missing = [], defaultdict(list)
    for entry in estimates(stored):
        if (note := str(entry.get("note") or "")).startswith("left out:"):
            missing[note].append(entry["name"])
        else:
            entries.append(entry)
    missing_lines = ["\n".join(f"- {', '.join(names)}: {note}" for note, names in missing.items())] if missing else []
    rows = [
        (entry["name"], format_number(entry["value"]), entry["unit"], _interval(entry.get("interval")),
         _null(entry.get("null")), format_number(entry.get("episodes")))
        for entry in entries
    ]  # fmt: skip
    definitions = "\n".join(
        f"- **{entry['name']}**: {entry['definition']}{_note(entry)}" for entry in entries if entry.get("definition")
    )
    return "\n\n".join(
        (
            heading,
            *_origin(stored, facts),
            table(("statistic", "value", "unit", "95 % interval", "null distribution", "episodes"), rows),
            *missing_lines,
            *_routes(route_statistics(stored)),
            f"<details><summary>Definitions</summary>\n\n{definitions}\n\n</details>",
        )
    )


def _origin(stored: dict[str, Any], facts: DatasetFacts) -> list[str]:
    version = stored.get("definition_version")
    definitions = f" by version {version} of the definitions" if version else ""
    reason = stale_statistics_reason(stored, len(facts.episodes))
    return [
        *([f"**Stale.** {reason}"] if reason else []),
        f"From `{STATISTICS_FILE}`, written by `copolicy-dataset stats`{definitions}.",
    ]


def _routes(routes: RouteStatistics | None) -> list[str]:
    """Entropy of each configuration, in a collapsed block since there may be dozens."""
    if routes is None or not routes.configurations:
        return []
    interval = "95 % interval"
    header = ("configuration", "episodes", "routes", "entropy, bits", interval, "effective modes", interval)
    rows = [
        (entry["name"], entry["episodes"], ", ".join(f"{label} {count}" for label, count in entry["counts"].items()),
         format_number(entry.get("entropy_bits")), _interval(entry.get("interval")),
         format_number(entry.get("effective_modes")), _interval(entry.get("effective_modes_interval")))
        for entry in routes.configurations
    ]  # fmt: skip
    title = f"Routes of {routes.played_by} in each of {len(rows)} configurations"
    return [f"<details><summary>{title}</summary>\n\n{table(header, rows)}\n\n</details>"]


def _interval(interval: list | None) -> str:
    return "-" if not interval else f"{format_number(interval[0])} to {format_number(interval[1])}"


def _null(null: dict | None) -> str:
    if not null:
        return "-"
    return f"{format_number(null.get('mean'))} ({format_number(null.get('low'))} to {format_number(null.get('high'))})"


def _note(entry: dict) -> str:
    return f" ({entry['note']})" if entry.get("note") else ""
