"""The partner score of robots, with its uncertainty and that of their ranking.

The score of a robot with a partner is the proportion of episodes that succeed within `FACTOR` times the median time of
the partner's own kind with itself on the same map, at a mean interaction force of at most `FACTOR` times that of the
own kind. Success alone is the partner's as much as the robot's: a capable partner reaches the goal with a robot that
does nothing, in more than twice the time. Success in time alone is also reached by a robot that knows the map and never
yields, against a partner that gives way; what the partner has to bear shows in the force. The own kind as the
reference makes scores with slow and fast, strong and weak partners comparable, and the map as the unit leaves its
length out. The partner score is the mean over partners. In a task without an interaction measure the force is left out.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array

from ..comparison.paired import REPLICATES
from .map_bootstrap import MapBootstrap
from .measures import MEASURES, OwnKind, Row, map_of

FACTOR = 1.5
"""Factor on the own kind's median time and force within which an episode counts."""

Cells = Mapping[str, Mapping[str, Sequence[Row]]]
"""Rows by robot and partner."""


def references(own_rows: Sequence[Row]) -> dict[str, OwnKind] | None:
    """The reference of each map; a map without a success of the own kind gets the medians over all maps.

    Returns:
        None if the own kind never succeeded.
    """
    every = [row for row in own_rows if row["success"]]
    if not every:
        return None
    by_map: dict[str, list[Row]] = {map_of(row): [] for row in own_rows}
    for row in every:
        by_map[map_of(row)].append(row)
    return {name: OwnKind.of(rows or every) for name, rows in by_map.items()}


def in_time(row: Row, reference: OwnKind) -> bool:
    """Whether an episode succeeded within `FACTOR` times the own kind's time."""
    return bool(row["success"]) and row["time_s"] <= FACTOR * reference.time_s


def counts(row: Row, reference: OwnKind) -> bool:
    """Whether an episode counts for the score: `in_time`, and not above `FACTOR` times the own kind's force."""
    force = row["interaction_mean"]
    gentle = reference.force is None or force is None or force <= FACTOR * reference.force
    return in_time(row, reference) and gentle


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
        `robots` with score, standard error, interval, proportion in time, scores by partner and, if ranked, the
        proportion of replicates in which it is first; `separation` of robots from floors; empty if no partner has a
        reference.
    """
    by_partner_maps = {name: found for name, rows in own_rows.items() if (found := references(rows)) is not None}
    if not by_partner_maps:
        return {}
    values: dict[str, dict[str, list[tuple[str, float]]]] = {robot: {} for robot in cells}
    timely: dict[str, list[float]] = {robot: [] for robot in cells}
    for partner, reference in by_partner_maps.items():
        for robot, by_partner in cells.items():
            rows = by_partner[partner]
            values[robot][partner] = [(map_of(row), counts(row, reference[map_of(row)])) for row in rows]
            timely[robot].append(float(np.mean([in_time(row, reference[map_of(row)]) for row in rows])))
    bootstrap = MapBootstrap.of(values, {partner: _maps(cells, partner) for partner in by_partner_maps}, seed)
    first = _first({robot: bootstrap.totals(robot) for robot in ranked})
    robots = {
        robot: {
            **bootstrap.estimate(robot),
            "in_time": float(np.mean(timely[robot])),
            "by_partner": {partner: bootstrap.estimate(robot, partner) for partner in by_partner_maps},
            **({"first": first[robot]} if robot in first else {}),
        }
        for robot in cells
    }
    return {
        "robots": robots,
        "separation": bootstrap.differences(ranked, floors),
        "maps": bootstrap.maps,
        "replicates": REPLICATES,
    }


def gave_way(cells: Cells, ranked: Sequence[str], floors: Sequence[str], seed: int = 0) -> dict[str, Any]:
    """Who gives way, which the score does not see: in what proportion of adaptations the robot did.

    Of an episode, then the mean over the episodes with an adaptation, then over the partners with such episodes.

    Args:
        ranked, floors: see `partner_scores`; robots without an adaptation are left out.

    Returns:
        `robots` with mean, standard error, interval and number of adaptations; `separation` of robots from floors,
        over the partners with which both have an adaptation; empty if there is no adaptation.
    """
    measure = MEASURES["gave_way"].value
    values: dict[str, dict[str, list[tuple[str, float]]]] = {}
    numbers: dict[str, int] = {}
    for robot, by_partner in cells.items():
        found = {
            partner: [(map_of(row), value) for row in rows if (value := measure(row, None)) is not None]
            for partner, rows in by_partner.items()
        }
        if any(found.values()):
            values[robot] = found
            numbers[robot] = sum(row["adaptations"] for rows in by_partner.values() for row in rows)
    if not values:
        return {}
    partners = dict.fromkeys(partner for by_partner in cells.values() for partner in by_partner)
    bootstrap = MapBootstrap.of(values, {partner: _maps(cells, partner) for partner in partners}, seed)
    return {
        "robots": {robot: {**bootstrap.estimate(robot), "adaptations": number} for robot, number in numbers.items()},
        "separation": bootstrap.differences(
            [robot for robot in ranked if robot in values], [floor for floor in floors if floor in values]
        ),
    }


def _maps(cells: Cells, partner: str) -> list[str]:
    """Maps of the episodes with a partner, the same for all robots that met it."""
    return list(dict.fromkeys(map_of(row) for by_partner in cells.values() for row in by_partner.get(partner, ())))


def _first(totals: Mapping[str, Array]) -> dict[str, float]:
    """Proportion of replicates in which each robot has the largest score; equal ones share it."""
    if not totals:
        return {}
    values = np.array(list(totals.values()))  # (robots, replicates)
    best = np.isclose(values, values.max(axis=0))
    return dict(zip(totals, (best / best.sum(axis=0)).mean(axis=1).tolist(), strict=True))
