"""The routes in stored statistics: how mixed they are in each configuration, and how far from those of people.

Cards and the report show the same numbers; this is where both get them from.
"""

import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.meta_files import STATISTICS_FILE

_MIRROR = str.maketrans("LR", "RL")
_PLAYED = {"human": "people", "simulated": "simulated pairs", "upstream": "pairs of the original's files"}


@dataclass(frozen=True)
class HumanDistance:
    """Jensen-Shannon divergence from the human routes, for one number of obstacles.

    Attributes:
        bits: 0 the same, 1 nothing in common; None where `note` says why not.
        interval: 95 percent.
        chance: low, mean and high of what two draws from one distribution would give.
        routes: `word`, `ours` and `human` of each, how many episodes and human demonstrations took it, in the reading
            of the human labels that is nearer.
        reading: `as labelled`, or `mirrored` where the human L and R were exchanged.
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
    """Everything about routes that a card or the report shows.

    Attributes:
        entropy: the estimate over configurations, with `value`, `interval`, `definition` and `effective_modes`; None
            where not stored.
        configurations: name, episodes, counts, entropy and effective modes of each, most mixed first.
        played_by: who played the episodes, in words.
        human_source: where the human routes come from.
    """

    entropy: dict[str, Any] | None
    configurations: tuple[dict[str, Any], ...]
    distances: tuple[HumanDistance, ...]
    played_by: str
    human_source: str

    def to_json(self) -> dict[str, Any]:
        """For the page."""
        return asdict(self)


def route_statistics(stored: dict[str, Any]) -> RouteStatistics | None:
    """The routes in `meta/copolicy_stats.json`, None where it holds nothing about them.

    Raises:
        FileFormatError: a configuration without its routes.
    """
    family = stored.get("statistics", {}).get("routes")
    if not isinstance(family, dict):
        return None
    stated = family.get("route_entropy")
    details = (stated or {}).get("details", {})
    configurations = details.get("configurations", {})
    without = [name for name, entry in configurations.items() if "counts" not in entry]
    if without:
        raise FileFormatError(STATISTICS_FILE, "routes of each configuration (run copolicy-dataset stats)", without[0])
    entropy = None
    if stated is not None:
        entropy = {name: entry for name, entry in stated.items() if name != "details"}
        entropy["effective_modes"] = details.get("effective_modes")
    distances = [
        _distance(int(name.split("_")[2]), entry)
        for name, entry in family.items()
        if re.fullmatch(r"human_distance_\d+_obstacles", name) and "details" in entry
    ]
    return RouteStatistics(
        entropy,
        tuple(_most_mixed_first({"name": name, **entry} for name, entry in configurations.items())),
        tuple(sorted(distances, key=lambda distance: distance.obstacles)),
        played_by(stored.get("dataset", {}).get("sources", {})),
        stored.get("human_reference", {}).get("source", ""),
    )


def played_by(sources: dict[str, int]) -> str:
    """`simulated pairs`, or several with their episodes."""
    names = [(_PLAYED.get(source, source or "source not stated"), count) for source, count in sources.items()]
    if len(names) == 1:
        return names[0][0]
    return ", ".join(f"{name} ({count})" for name, count in names)


def _most_mixed_first(entries: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    def mixed(entry: dict[str, Any]) -> tuple:
        bits = entry.get("entropy_bits")
        return (bits is None, -(bits or 0.0), entry["name"])

    return sorted(entries, key=mixed)


def _distance(obstacles: int, entry: dict[str, Any]) -> HumanDistance:
    details = entry["details"]
    reading = details.get("reading", "as labelled")
    human = {
        word.translate(_MIRROR) if reading == "mirrored" else word: count
        for word, count in details.get("human", {}).get("counts", {}).items()
    }
    ours = details.get("counts", {})
    null = entry.get("null")
    interval = entry.get("interval")
    return HumanDistance(
        obstacles,
        entry["value"],
        (interval[0], interval[1]) if interval else None,
        (null["low"], null["mean"], null["high"]) if null else None,
        null["p"] if null else None,
        entry.get("episodes", sum(ours.values())),
        sum(human.values()),
        tuple(
            {"word": word, "ours": ours.get(word, 0), "human": human.get(word, 0)} for word in sorted({*ours, *human})
        ),
        reading,
        entry.get("definition", ""),
        entry.get("note", ""),
    )
