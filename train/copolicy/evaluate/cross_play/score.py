"""The partner score of robots, with its uncertainty and that of their ranking.

The score of a robot with a partner is the proportion of episodes that succeed within `TIME_FACTOR` times the median
time that the partner's own kind needs with itself on the same map. A success alone does not count: a capable partner
brings the table to the goal although the robot does nothing, but takes more than twice the time. The own kind as the
reference makes scores with slow and fast partners comparable, and the map as the unit leaves its length out. The
partner score is the mean over partners.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array

from ..comparison.paired import REPLICATES
from .measures import Row, map_of

TIME_FACTOR = 1.5

Cells = Mapping[str, Mapping[str, Sequence[Row]]]
"""Rows by robot and partner."""


def reference_times(own_rows: Sequence[Row]) -> dict[str, float] | None:
    """Median time of the own kind's successes by map; a map without one gets the median over all maps.

    Returns:
        None if the own kind never succeeded.
    """
    every = [row["time_s"] for row in own_rows if row["success"]]
    if not every:
        return None
    by_map: dict[str, list[float]] = {map_of(row): [] for row in own_rows}
    for row in own_rows:
        if row["success"]:
            by_map[map_of(row)].append(row["time_s"])
    return {name: float(np.median(times or every)) for name, times in by_map.items()}


def scored(rows: Sequence[Row], reference: Mapping[str, float]) -> list[bool]:
    """Whether each episode counts."""
    return [bool(row["success"]) and row["time_s"] <= TIME_FACTOR * reference[map_of(row)] for row in rows]


def partner_scores(
    cells: Cells, own_rows: Mapping[str, Sequence[Row]], ranked: Sequence[str], floors: Sequence[str], seed: int = 0
) -> dict[str, Any]:
    """Scores of all robots, and the ranking of some.

    The bootstrap draws maps, with all episodes of a map together: the same maps for all robots, and for all partners
    with the same starts.

    Args:
        own_rows: rows of each partner's own kind; partners without are left out of the score.
        ranked: robots to rank.
        floors: robots from which the others are to be told apart.

    Returns:
        `robots` with score, standard error, interval, scores by partner and, if ranked, the proportion of replicates in
        which it is first; `separation` of robots from floors; empty if no partner has a reference.
    """
    references = {name: times for name, rows in own_rows.items() if (times := reference_times(rows)) is not None}
    if not references:
        return {}
    rng = np.random.default_rng(seed)
    weights: dict[tuple[str, ...], Array] = {}
    means: dict[str, dict[str, float]] = {robot: {} for robot in cells}
    replicates: dict[str, dict[str, Array]] = {robot: {} for robot in cells}
    for partner, reference in references.items():
        maps = tuple(reference)
        if maps not in weights:
            uniform = np.full(len(maps), 1 / len(maps))
            weights[maps] = rng.multinomial(len(maps), uniform, size=REPLICATES).astype(float)
        index = {name: position for position, name in enumerate(maps)}
        for robot, by_partner in cells.items():
            rows = by_partner[partner]
            positions = [index[map_of(row)] for row in rows]
            sums = np.bincount(positions, scored(rows, reference), minlength=len(maps))
            counts = np.bincount(positions, minlength=len(maps))
            means[robot][partner] = float(sums.sum() / counts.sum())
            replicates[robot][partner] = (weights[maps] @ sums) / (weights[maps] @ counts)
    totals = {robot: np.mean(list(by_partner.values()), axis=0) for robot, by_partner in replicates.items()}
    first = _first({robot: totals[robot] for robot in ranked})
    # With one map every replicate is the same, which is no uncertainty of zero.
    known = all(len(maps) > 1 for maps in weights)
    robots = {
        robot: {
            **_estimate(float(np.mean(list(means[robot].values()))), totals[robot], known),
            "by_partner": {
                partner: _estimate(mean, replicates[robot][partner], known) for partner, mean in means[robot].items()
            },
            **({"first": first[robot]} if robot in first else {}),
        }
        for robot in cells
    }
    separation = {
        robot: {
            floor: _difference(robots[robot]["mean"] - robots[floor]["mean"], totals[robot] - totals[floor], known)
            for floor in floors
        }
        for robot in ranked
        if robot not in floors
    }
    return {"robots": robots, "separation": separation, "maps": max(map(len, weights)), "replicates": REPLICATES}


def _estimate(mean: float, values: Array, known: bool) -> dict[str, Any]:
    if not known:
        return {"mean": mean, "standard_error": None, "bootstrap_95": None}
    low, high = np.quantile(values, (0.025, 0.975))
    return {"mean": mean, "standard_error": float(values.std()), "bootstrap_95": [float(low), float(high)]}


def _difference(mean: float, values: Array, known: bool) -> dict[str, Any]:
    estimate = _estimate(mean, values, known)
    error = estimate["standard_error"]
    return {**estimate, "standard_errors": mean / error if error else None}


def _first(totals: Mapping[str, Array]) -> dict[str, float]:
    """Proportion of replicates in which each robot has the largest score; equal ones share it."""
    if not totals:
        return {}
    values = np.array(list(totals.values()))  # (robots, replicates)
    best = np.isclose(values, values.max(axis=0))
    return dict(zip(totals, (best / best.sum(axis=0)).mean(axis=1).tolist(), strict=True))
