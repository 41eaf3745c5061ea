"""Route statistics: sides of the obstacles, entropy by number of obstacles, and distance to people's routes."""

from collections import Counter
from dataclasses import replace

import numpy as np
from scipy.stats import binomtest

from copolicy.dataset.statistics.estimate import Estimate
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.route_entropy import (
    decided_labels,
    label_entropy,
    route_class_count,
    success_condition,
)
from copolicy.dataset.statistics.trajectories import Trajectories

from ..routes import winding
from .human_routes import human_distance

CLEAR_WINDING = 0.1
"""Winding around an obstacle, turns, below which the side counts as unclear."""


def route_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Route classes, their entropy by number of obstacles, and the distance to people's routes."""
    taken = decided_labels(data)
    return {
        "route_class": _route_class(data, taken),
        "route_entropy_pooled": _pooled_entropy(taken, rng),
        **human_distance(data, rng),
    }


def _route_class(data: Trajectories, taken: dict[int, str]) -> Estimate:
    sides: dict[str, dict] = {}
    unclear = 0
    for index, word in taken.items():
        path, obstacles = data.path(index), data.rows[index].scenario.obstacles
        unclear += any(abs(winding(path, centre)) < CLEAR_WINDING for centre in obstacles)
        entry = sides.setdefault(str(data.configurations[index]), {"episodes": 0, "left": [0] * len(word)})
        entry["episodes"] += 1
        entry["left"] = [left + (letter == "L") for left, letter in zip(entry["left"], word, strict=True)]
    for entry in sides.values():
        entry["left_interval"] = [
            binomtest(left, entry["episodes"]).proportion_ci(method="wilson") for left in entry["left"]
        ]
    definition = (
        "Episodes with a route class: for each obstacle the sign of the winding of the table's path around it, L below "
        "it on screen when carried to the right, R above; letters by atan2(y, x) of the obstacles. "
        f"{success_condition(data)}"
    )
    estimate = route_class_count(data, taken, definition)
    first, second = estimate.details.items()  # the document has the others between and after them
    left_by_obstacle = ("left_by_obstacle", dict(sorted(sides.items())))
    return replace(estimate, details=dict((first, ("unclear_side", unclear), second, left_by_obstacle)))


def _pooled_entropy(taken: dict[int, str], rng: np.random.Generator) -> Estimate:
    sizes = sorted({len(word) for word in taken.values()})
    details = {
        f"{size}_obstacles": label_entropy(Counter(word for word in taken.values() if len(word) == size), size, rng)
        for size in sizes
    }
    return Estimate(
        None,
        "bits",
        "Entropy of the route classes over all configurations with one, two and three obstacles (in details): it mixes "
        "maps and does not measure multimodality, but it can be compared with labels without maps.",
        len(taken),
        note="one value a number of obstacles, in details",
        details=details,
    )
