"""Measures of a cell: the episodes of one robot with one partner."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.scenarios import base_name
from copolicy.dataset.task import PairTask

from ..behaviours.adaptation import SHORTEST_S, WITHIN_S, robot_gave_way
from ..behaviours.definitions import without_strategies
from ..behaviours.motion import Motion, common_rate
from ..partner_study.episode_result import DEADLOCK_S, PartnerEpisodeResult
from ..trajectories import trajectory_of

Row = dict[str, Any]
"""Row of an episode in the file of a cell."""


class OwnKind(NamedTuple):
    """What a partner's own kind needs: medians over its successes."""

    time_s: float
    force: float | None

    @classmethod
    def of(cls, rows: Sequence[Row]) -> "OwnKind":
        """Of successes, at least one."""
        forces = [row["interaction_mean"] for row in rows if row["interaction_mean"] is not None]
        return cls(float(np.median([row["time_s"] for row in rows])), float(np.median(forces)) if forces else None)


class Measure(NamedTuple):
    """A measure of an episode.

    Attributes:
        label: with its unit, for tables.
        digits: decimals in tables.
        scale: factor in tables, 100 for a proportion in percent.
        lower_is_better: None if neither is.
        value: value of an episode from its row and its partner's own kind; None if it has none.
        proportion: whether an episode counts 0 or 1.
    """

    label: str
    digits: int
    scale: float
    lower_is_better: bool | None
    value: Callable[[Row, OwnKind | None], float | None]
    proportion: bool = False


def _time(row: Row, own: OwnKind | None) -> float | None:
    return row["time_s"] if row["success"] else None


def _relative_time(row: Row, own: OwnKind | None) -> float | None:
    return row["time_s"] / own.time_s if row["success"] and own is not None else None


def _relative_force(row: Row, own: OwnKind | None) -> float | None:
    return row["interaction_mean"] / own.force if own is not None and own.force else None


def _deadlock(row: Row, own: OwnKind | None) -> float | None:
    return None if row["deadlock_s"] is None else row["deadlock_s"] / max(row["time_s"], 1e-9)


def _near_miss(row: Row, own: OwnKind | None) -> float | None:
    return None if row["near_miss"] is None else float(row["near_miss"])


def _gave_way(row: Row, own: OwnKind | None) -> float | None:
    return row["robot_gave_way"] / row["adaptations"] if row["adaptations"] else None


MEASURES: dict[str, Measure] = {
    "success": Measure("success, %", 1, 100, False, lambda row, own: float(row["success"]), proportion=True),
    "time_s": Measure("time of successes, s", 1, 1, True, _time),
    "relative_time": Measure("time / own kind's", 2, 1, True, _relative_time),
    "interaction_force": Measure("interaction force", 3, 1, True, lambda row, own: row["interaction_mean"]),
    "relative_force": Measure("force / own kind's", 2, 1, True, _relative_force),
    "robot_share": Measure("robot's share of work", 2, 1, None, lambda row, own: row["robot_share"]),
    "deadlock": Measure("time in deadlock, %", 1, 100, True, _deadlock),
    "smallest_distance": Measure("smallest distance", 1, 1, False, lambda row, own: row["smallest_distance"]),
    "near_misses": Measure("near misses, %", 1, 100, True, _near_miss, proportion=True),
    "gave_way": Measure("robot gave way, %", 1, 100, None, _gave_way),
}
"""By name in results, in the order of tables."""


def label(name: str, length_unit: str) -> str:
    """Label of a measure with its unit."""
    text = MEASURES[name].label
    return f"{text}, {length_unit}" if name == "smallest_distance" and length_unit else text


def episode_rows(task: PairTask, robot: str, episodes: Sequence[PartnerEpisodeResult]) -> list[Row]:
    """Rows of episodes: those of the partner study, with the smallest distance to an obstacle, and who gave way.

    Args:
        robot: name of the robot.
    """
    rows = []
    counted: Sequence[Sequence[int | None]] = [(None, None)] * len(episodes)
    if not without_strategies(task):
        trajectories = [trajectory_of(robot, episode) for episode in episodes]
        counted = robot_gave_way(Motion(task, trajectories, common_rate([task.spec.record_hz]))).tolist()
    limit = task.studies.near_miss
    for episode, (adaptations, gave_way) in zip(episodes, counted, strict=True):
        distance = episode.smallest_distance
        near = None if distance is None or limit is None else distance < limit
        own = {"smallest_distance": distance, "near_miss": near}
        rows.append({**episode.to_json(), **own, "adaptations": adaptations, "robot_gave_way": gave_way})
    return rows


def own_kind_of_start(rows: Sequence[Row] | None) -> Callable[[Row], OwnKind | None]:
    """A partner's own kind on the start of an episode; None if it did not succeed there."""
    by_start: dict[int, list[Row]] = {}
    for row in rows or ():
        if row["success"]:
            by_start.setdefault(row["map_index"], []).append(row)
    found = {index: OwnKind.of(successes) for index, successes in by_start.items()}
    return lambda row: found.get(row["map_index"])


def summary(rows: Sequence[Row], own: Callable[[Row], OwnKind | None]) -> dict[str, dict[str, Any] | None]:
    """Mean, standard error over episodes and number of episodes of each measure; None if no episode has it."""
    result: dict[str, dict[str, Any] | None] = {}
    for name, measure in MEASURES.items():
        values = [measure.value(row, own(row)) for row in rows]
        known = [value for value in values if value is not None and math.isfinite(value)]
        result[name] = mean_and_error(known, measure.proportion)
    return result


def mean_and_error(values: Sequence[float], proportion: bool = False) -> dict[str, Any] | None:
    """Mean, standard error of the mean (None for one value) and number of values; None without values.

    The error is the sample standard deviation (divisor n - 1) over sqrt(n); of a proportion of zeros and ones it is
    sqrt(p (1 - p) / n), as in all results.
    """
    if not values:
        return None
    n = len(values)
    error = float(np.std(values, ddof=0 if proportion else 1) / math.sqrt(n)) if n > 1 else None
    return {"mean": float(np.mean(values)), "standard_error": error, "n": n}


def over_partners(cells: Mapping[str, Any], name: str) -> float | None:
    """Mean over partners of a measure of a robot, of its cells by partner; None if no cell has it."""
    values = [found["mean"] for cell in cells.values() if (found := cell["measures"][name]) is not None]
    return sum(values) / len(values) if values else None


def map_of(row: Row) -> str:
    """The map of an episode without its start orientation, the unit of the bootstrap."""
    return base_name(row["map_id"])


def definitions(task: PairTask) -> dict[str, str]:
    """Definitions of the measures."""
    words, unit = task.studies.definitions, task.outline.unit if task.outline else "?"
    ends = words.get("success", f"end with {' or '.join(task.spec.successes)}")
    limit = task.studies.near_miss
    return {
        "unit_of_analysis": "an episode; standard errors are over the episodes of a cell (one training of each "
        "policy), those of the partner score over maps",
        "success": f"proportion of episodes that {ends}",
        "time_s": "simulated time of successes",
        "relative_time": "time of a success divided by the median time that the partner's own kind at the robot's seat "
        "needs on the same start; only starts on which it succeeds",
        "interaction_force": words.get("interaction_force", "magnitude of what the task measures"),
        "relative_force": "interaction force divided by the median force of the successes of the partner's own kind on "
        "the same start",
        "robot_share": "proportion of both players' positive work that the robot does; 0.5 is even",
        "deadlock": f"proportion of an episode in stand-stills of {DEADLOCK_S:g} s or more",
        "smallest_distance": f"smallest distance of the outlines of body and obstacles in an episode, {unit}",
        **({} if limit is None else {"near_misses": f"episodes with a smallest distance below {limit:g} {unit}, of all "
                                                    "episodes, collisions included"}),
        "gave_way": "proportion of the adaptations of an episode in which the robot gave way, alone or as well as the "
        f"partner; only of episodes with one, and means only over partners with such episodes: the players preferred "
        f"different strategies for {SHORTEST_S:g} s or more and, within {WITHIN_S:g} s, the same",
        "wall_s": "wall time of the simulation of the cell, with inference",
    }  # fmt: skip


def not_measured(task: PairTask, cells: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """For each measure that is null in every cell, the part that the task lacks."""
    parts = {
        "interaction_force": "interaction measure",
        "relative_force": "interaction measure",
        "robot_share": "outline, which gives forces and paths",
        "deadlock": "measure of standing still (`studies.at_rest`)",
        "smallest_distance": "obstacles in its outline",
        "near_misses": "obstacles in its outline, or no distance of a near miss (`studies.near_miss`)",
        "gave_way": without_strategies(task),
    }
    null = [
        name for name in parts if all(cell["measures"][name] is None for row in cells.values() for cell in row.values())
    ]
    if "interaction_force" not in null and "relative_force" in null:
        null.remove("relative_force")  # an own kind without success is the reason, which `no_own_kind` names
    return {name: task.missing(parts[name]) if parts[name] else "no adaptation in any episode" for name in null}
