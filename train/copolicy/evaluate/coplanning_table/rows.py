"""The rows of the table: success of each method over its training seeds, differences, and the published numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.task import PublishedMethod, Studies

from ..comparison.compare import method_summary
from ..comparison.paired import BOOTSTRAP, between_runs, mean_over, paired_differences, welch
from ..comparison.results import StudyResult
from .evaluations import Evaluation
from .training_runs import TrainedMethod, TrainingRun

DEFINITIONS = {
    "best": "the highest success rate of a training seed; the best of several seeds is biased upward by the selection",
    "mean": "mean of the success rates of the training seeds",
    "standard_error": "standard deviation between seeds / sqrt(number of seeds); with one seed binomial over its "
    "episodes, sqrt(p (1 - p) / episodes), which does not cover the choice of the training seed",
    "time_s": "simulated time of successful episodes: mean over seeds of a seed's mean, ± standard error over seeds",
    "interaction": "mean over seeds of the mean over episodes, ± standard error over seeds",
    "planning_ms": "wall time of one call of the policy, after the first, for all running episodes of the study at "
    "once; tests/benchmarks/planning_methods.py measures one decision at a time",
    "parameters": "trained parameters of the policy",
    "samples": "training samples drawn: steps x batch size x processes",
    "difference": "the reference (first method) minus this method on the same maps, each map the mean over a method's "
    f"seeds; standard error and interval: {BOOTSTRAP}; training seeds are not resampled",
    "between_seeds": "Welch's t interval of the difference between training seeds, with two or more of each method",
}


def table_row(
    method: TrainedMethod, results: Sequence[Mapping[str, Evaluation]], studies: Studies
) -> tuple[dict[str, Any], dict[str, list[StudyResult]]]:
    """The row of a method, and the results that it summarises by map set.

    Args:
        results: for each run, its result by map set.
    """
    read = {maps: [StudyResult.read(evaluations[maps].path) for evaluations in results] for maps in results[0]}
    published = method.published(studies)
    first = method.runs[0]
    seconds = [run.seconds for run in method.runs if run.seconds is not None]
    row = {
        "method": method.name,
        "policy": first.config.get("type"),
        "preset": first.config.get("preset"),
        "seeds": len(method.runs),
        "fps": first.conditions.fps,
        "data": first.data,
        "actions_per_chunk": next(iter(results[0].values())).result["settings"]["actions_per_plan"],
        "parameters": next(iter(results[0].values())).result["policy"].get("parameters"),
        "steps": first.steps,
        "batch_size": first.batch_size,
        "samples": first.samples,
        "training_s": float(np.mean(seconds)) if len(seconds) == len(method.runs) else None,
        "unfinished": next((run.unfinished for run in method.runs if run.unfinished), ""),
        "maps": {
            maps: _on_maps(runs, [evaluations[maps].result for evaluations in results], published, maps)
            for maps, runs in read.items()
        },
        "published": published.name if published else None,
        "published_planning_ms": published.planning_ms if published else None,
        "runs": [_run(run, evaluations) for run, evaluations in zip(method.runs, results, strict=True)],
    }
    return row, read


def _on_maps(
    runs: Sequence[StudyResult], results: Sequence[Mapping[str, Any]], published: PublishedMethod | None, maps: str
) -> dict[str, Any]:
    summary = method_summary([run.values for run in runs])
    success, planning = summary["success"], [result["summary"]["planning_ms_per_call"] for result in results]
    return {
        "best": success["max"],
        "mean": success["mean"],
        "standard_error": success["standard_error"],
        "standard_error_of": success["standard_error_of"],
        "per_seed": [run.success for run in runs],
        "episodes_per_seed": success["episodes"],
        "episodes": success["episodes"] * len(runs),
        "successes": sum(sum(bool(row["success"]) for row in run.rows) for run in runs),
        "time_s": summary["time_s"],
        "interaction": summary["interaction_mean"],
        "planning_ms_p50": _mean([spread["p50"] for spread in planning]),
        "planning_ms_mean": _mean([spread["mean"] for spread in planning]),
        **_published_on(published, maps),
    }


def _published_on(published: PublishedMethod | None, maps: str) -> dict[str, list[int]]:
    """Published counts on a map set: successes and episodes of the best seed and of all seeds."""
    if published is None or maps not in published.mean:
        return {}
    return {"published_best": list(published.best[maps]), "published_mean": list(published.mean[maps])}


def _run(run: TrainingRun, evaluations: Mapping[str, Evaluation]) -> dict[str, Any]:
    return {
        "folder": str(run.folder),
        "seed": run.seed,
        "steps": run.steps,
        "training_s": run.seconds,
        "weights_sha256": run.weights,
        "results": {maps: str(evaluation.path) for maps, evaluation in evaluations.items()},
    }


def reference_difference(
    reference: Mapping[str, Sequence[StudyResult]], other: Mapping[str, Sequence[StudyResult]]
) -> dict[str, Any]:
    """The differences `reference - other` in success on the same maps, by map set."""
    differences = {}
    for maps, first in reference.items():
        second = other[maps]
        paired = paired_differences(mean_over([run.values for run in first]), mean_over([run.values for run in second]))
        differences[maps] = {
            **paired["success"],
            "between_seeds": welch([run.success for run in first], [run.success for run in second]),
        }
    return differences


def published_rows(studies: Studies) -> list[dict[str, Any]]:
    """The published methods, as counts of successes and episodes by map set."""
    return [
        {
            "method": method.name,
            "planning_ms": method.planning_ms,
            "maps": {maps: {"best": list(method.best[maps]), "mean": list(method.mean[maps])} for maps in method.mean},
        }
        for method in studies.published
    ]


def _mean(values: Sequence[float | None]) -> float | None:
    return between_runs([value for value in values if value is not None])["mean"]
