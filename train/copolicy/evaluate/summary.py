"""What a study reports: success with its uncertainty, times, forces, by map."""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binomtest

from copolicy.dataset.task import PairTask

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

    from .coplan.rollouts import Outcome

_PARTS = {
    "interaction_force": "interaction measure",
    "robot_share": "outline, which tells forces and ways",
    "deadlock": "measure of standing still (`studies.at_rest`)",
}


def success_rate(successes: Sequence[bool]) -> dict[str, Any]:
    """Share of successes with its binomial standard error and Wilson's 95 % interval."""
    n = len(successes)
    p = sum(successes) / n
    interval = binomtest(sum(successes), n).proportion_ci(method="wilson")
    return {
        "mean": p,
        "standard_error": math.sqrt(p * (1 - p) / n),
        "wilson_95": [float(interval.low), float(interval.high)],
        "episodes": n,
    }


def percent(success: Mapping[str, Any]) -> str:
    """A success rate with its standard error, for a person."""
    return f"{100 * success['mean']:.1f} ± {100 * success['standard_error']:.1f} %"


def summarise(outcomes: Sequence["Outcome"], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`. Times to completion count successes only, as the paper's do.

    Args:
        policy: whose planning time is told; None where nothing planned.
    """
    planning_seconds, tables = (policy.planning_seconds, sum(policy.batch_sizes)) if policy else ([], 0)
    rows = [outcome.to_json() for outcome in outcomes]
    by_map: dict[str, list[bool]] = defaultdict(list)
    by_obstacles: dict[str, list[bool]] = defaultdict(list)
    for row in rows:
        by_map[row["map_id"]].append(row["success"])
        if "obstacles" in row:
            by_obstacles[str(row["obstacles"])].append(row["success"])
    forces = [np.abs(outcome.interaction) for outcome in outcomes if outcome.interaction is not None]
    return {
        "success": success_rate([row["success"] for row in rows]),
        "ended_by": dict(sorted(Counter(row["reason"] for row in rows).items())),
        "time_to_completion_s": _spread([row["time_s"] for row in rows if row["success"]]),
        "interaction_force": _mean_and_p95(np.concatenate(forces)) if forces else None,
        "planning_ms_per_call": _spread([1e3 * seconds for seconds in planning_seconds]),
        "planning_ms_per_table": 1e3 * sum(planning_seconds) / tables if tables else None,
        **(
            {"by_obstacles": {count: success_rate(flags) for count, flags in sorted(by_obstacles.items())}}
            if by_obstacles
            else {}
        ),
        "by_map": {
            name: {"success": sum(flags) / len(flags), "episodes": len(flags)} for name, flags in by_map.items()
        },
    }


def not_measured(task: PairTask, summary: Mapping[str, Any]) -> dict[str, Any]:
    """The entry of a result with the reason of each measure that its task lacks and that is null for it."""
    reasons = {name: task.missing(part) for name, part in _PARTS.items() if name in summary and summary[name] is None}
    return {"not_measured": reasons} if reasons else {}


def _mean_and_p95(values: np.ndarray) -> dict[str, float]:
    return {"mean": float(values.mean()), "p95": float(np.quantile(values, 0.95))}


def _spread(values: Sequence[float]) -> dict[str, float | int | None]:
    if not values:
        return {"mean": None, "standard_error": None, "p50": None, "p95": None, "n": 0}
    n = len(values)
    return {
        "mean": float(np.mean(values)),
        "standard_error": float(np.std(values, ddof=1) / math.sqrt(n)) if n > 1 else None,
        "p50": float(np.quantile(values, 0.5)),
        "p95": float(np.quantile(values, 0.95)),
        "n": n,
    }
