"""Summary of a study: success rate with its uncertainty, times and forces, in total and by map."""

import math
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.task import PairTask

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

    from .coplan.rollouts import EpisodeResult

# The part of a task that each measure of the summary needs.
_REQUIRED_PARTS = {
    "interaction_force": "interaction measure",
    "robot_share": "outline, which gives forces and paths",
    "deadlock": "measure of standing still (`studies.at_rest`)",
}


def success_rate(successes: Sequence[bool]) -> dict[str, Any]:
    """Success rate with its binomial standard error and Wilson's 95 % interval."""
    from scipy.stats import binomtest  # takes most of the time of `copolicy-eval --help`

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
    """Formats a success rate and its standard error in percent."""
    return f"{100 * success['mean']:.1f} ± {100 * success['standard_error']:.1f} %"


def summarise(episodes: Sequence["EpisodeResult"], policy: "Checkpoint | None") -> dict[str, Any]:
    """The summary of `eval.json`. Times to completion count successes only, as in the paper.

    Args:
        policy: policy whose inference times are reported; None for a scripted robot.
    """
    inference_seconds, chunks = (policy.inference_seconds, sum(policy.batch_sizes)) if policy else ([], 0)
    rows = [episode.to_json() for episode in episodes]
    by_map: dict[str, list[bool]] = defaultdict(list)
    by_obstacles: dict[str, list[bool]] = defaultdict(list)
    for row in rows:
        by_map[row["map_id"]].append(row["success"])
        if "obstacles" in row:
            by_obstacles[str(row["obstacles"])].append(row["success"])
    forces = [np.abs(episode.interaction) for episode in episodes if episode.interaction is not None]
    return {
        "success": success_rate([row["success"] for row in rows]),
        "ended_by": dict(sorted(Counter(row["reason"] for row in rows).items())),
        "time_to_completion_s": _spread([row["time_s"] for row in rows if row["success"]]),
        "interaction_force": _mean_and_p95(np.concatenate(forces)) if forces else None,
        "planning_ms_per_call": _spread([1e3 * seconds for seconds in inference_seconds]),
        "planning_ms_per_table": 1e3 * sum(inference_seconds) / chunks if chunks else None,
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
    """The `not_measured` entry of a result: for each measure that is null, the part that the task lacks."""
    null = [name for name in _REQUIRED_PARTS if name in summary and summary[name] is None]
    return {"not_measured": {name: task.missing(_REQUIRED_PARTS[name]) for name in null}} if null else {}


def _mean_and_p95(values: Array) -> dict[str, float]:
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
