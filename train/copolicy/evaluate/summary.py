"""What a study reports: success with its uncertainty, times, forces, by map."""

import math
from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binomtest

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

    from .coplan.rollouts import Outcome


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


def summarise(outcomes: Sequence["Outcome"], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`. Times to completion count successes only, as the paper's do.

    Args:
        policy: whose planning time is told; None where nothing planned.
    """
    planning_seconds, tables = (policy.planning_seconds, sum(policy.batch_sizes)) if policy else ([], 0)
    rows = [outcome.to_json() for outcome in outcomes]
    reasons: dict[str, int] = defaultdict(int)
    by_map: dict[str, list[bool]] = defaultdict(list)
    by_obstacles: dict[str, list[bool]] = defaultdict(list)
    for row in rows:
        reasons[row["reason"]] += 1
        by_map[row["map_id"]].append(row["success"])
        by_obstacles[str(row["obstacles"])].append(row["success"])
    forces = np.abs(np.concatenate([outcome.interaction for outcome in outcomes]))
    return {
        "success": success_rate([row["success"] for row in rows]),
        "ended_by": dict(sorted(reasons.items())),
        "time_to_completion_s": _spread([row["time_s"] for row in rows if row["success"]]),
        "interaction_force": {"mean": float(forces.mean()), "p95": float(np.quantile(forces, 0.95))},
        "planning_ms_per_call": _spread([1e3 * seconds for seconds in planning_seconds]),
        "planning_ms_per_table": 1e3 * sum(planning_seconds) / tables if tables else None,
        "by_obstacles": {count: success_rate(flags) for count, flags in sorted(by_obstacles.items())},
        "by_map": {
            name: {"success": sum(flags) / len(flags), "episodes": len(flags)} for name, flags in by_map.items()
        },
    }


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
