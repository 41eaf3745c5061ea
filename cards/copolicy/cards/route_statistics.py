"""Reads the route statistics that cards and the report show: entropy by configuration, and distance from people."""

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.meta_files import STATISTICS_FILE

_MIRROR = str.maketrans("LR", "RL")
_PLAYERS = {"human": "people", "simulated": "simulated pairs", "upstream": "pairs of the original's files"}


@dataclass(frozen=True)
class HumanDistance:
    """Jensen-Shannon divergence from the human routes, for one number of obstacles.

    Attributes:
        bits: from 0 (equal) to 1 (disjoint); None with the reason in `note`.
        interval: 95 % interval.
        chance: low, mean and high of the null distribution (two samples of one distribution).
        routes: for each route `word`, `ours` (episodes) and `human` (demonstrations), with the human labels read as in
            `reading`.
        reading: `as labelled`, or `mirrored` (human L and R exchanged), whichever gives the smaller divergence.
    """

    obstacles: int
    bits: float | None
    interval: tuple[float, float] | None
    chance: tuple[float, float, float] | None
    p: float | None
    episodes: int
    demonstrations: int
    routes: tuple[dict[str, Any], ...]
    reading: str
    definition: str
    note: str


@dataclass(frozen=True)
class RouteStatistics:
    """The route statistics of a card or the report.

    Attributes:
        entropy: estimate over configurations, with `value`, `interval`, `definition` and `effective_modes`; None if not
            stored.
        configurations: name, episodes, counts, entropy and effective modes of each, highest entropy first.
        played_by: who played the episodes, in words.
        human_source: source of the human routes.
    """

    entropy: dict[str, Any] | None
    configurations: tuple[dict[str, Any], ...]
    distances: tuple[HumanDistance, ...]
    played_by: str
    human_source: str

    def to_json(self) -> dict[str, Any]:
        """The statistics as data of the report page."""
        return asdict(self)


def route_statistics(stored: dict[str, Any]) -> RouteStatistics | None:
    """Reads the route statistics of `meta/copolicy_stats.json`, None if it holds none.

    Raises:
        FileFormatError: a configuration without its routes.
    """
    family = stored.get("statistics", {}).get("routes")
    if not isinstance(family, dict):
        return None
    entropy_entry = family.get("route_entropy")
    details = (entropy_entry or {}).get("details", {})
    configurations = details.get("configurations", {})
    incomplete = [name for name, entry in configurations.items() if "counts" not in entry]
    if incomplete:
        raise FileFormatError(
            STATISTICS_FILE, "routes of each configuration (run copolicy-dataset stats)", incomplete[0]
        )
    entropy = None
    if entropy_entry is not None:
        entropy = {name: entry for name, entry in entropy_entry.items() if name != "details"}
        entropy["effective_modes"] = details.get("effective_modes")
    distances = [
        _distance(int(name.split("_")[2]), entry)
        for name, entry in family.items()
        if re.fullmatch(r"human_distance_\d+_obstacles", name) and "details" in entry
    ]
    return RouteStatistics(
        entropy,
        tuple(_highest_entropy_first({"name": name, **entry} for name, entry in configurations.items())),
        tuple(sorted(distances, key=lambda distance: distance.obstacles)),
        played_by(stored.get("dataset", {}).get("sources", {})),
        stored.get("human_reference", {}).get("source", ""),
    )


def played_by(sources: dict[str, int]) -> str:
    """Who played, in words; several sources with their numbers of episodes."""
    names = [(_PLAYERS.get(source, source or "source not stated"), count) for source, count in sources.items()]
    if len(names) == 1:
        return names[0][0]
    return ", ".join(f"{name} ({count})" for name, count in names)


def _highest_entropy_first(entries: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    def key(entry: dict[str, Any]) -> tuple:
        bits = entry.get("entropy_bits")
        return (bits is None, -(bits or 0.0), entry["name"])

    return sorted(entries, key=key)


def _distance(obstacles: int, entry: dict[str, Any]) -> HumanDistance:
    details = entry["details"]
    reading = details.get("reading", "as labelled")
    human = {
        label.translate(_MIRROR) if reading == "mirrored" else label: count
        for label, count in details.get("human", {}).get("counts", {}).items()
    }
    counts = details.get("counts", {})
    null = entry.get("null")
    interval = entry.get("interval")
    return HumanDistance(
        obstacles,
        entry["value"],
        (interval[0], interval[1]) if interval else None,
        (null["low"], null["mean"], null["high"]) if null else None,
        null["p"] if null else None,
        entry.get("episodes", sum(counts.values())),
        sum(human.values()),
        tuple(
            {"word": label, "ours": counts.get(label, 0), "human": human.get(label, 0)}
            for label in sorted({*counts, *human})
        ),
        reading,
        entry.get("definition", ""),
        entry.get("note", ""),
    )
