"""Summarises each method, and compares the first with each of the others."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .paired import BOOTSTRAP, EpisodeKey, Metrics, between_runs, mcnemar_exact, mean_over, paired_differences, welch
from .results import Method, StudyResult, subset

DEFINITIONS = {
    "success": "mean over training runs of a run's success rate; standard error between runs (with one run: "
    "binomial over its episodes, which does not cover the choice of training seed)",
    "time_s": "mean over runs of a run's mean time of successes",
    "interaction_mean": "mean over runs of the mean over episodes of |interaction force|, full forces",
    "difference": "first method minus the second on the same starts, each episode the mean over a method's runs",
    "bootstrap_95": f"{BOOTSTRAP}; training runs are not resampled",
    "between_runs": "Welch's t interval of the difference between training runs, with two or more of each method",
    "mcnemar": "exact, two-sided, with one run of each method and one episode per start",
}

Subset = Callable[[StudyResult], dict[EpisodeKey, Metrics]]


def compare(methods: Sequence[Method]) -> dict[str, Any]:
    """Compares methods of one protocol; the returned dict can be written as JSON."""
    first = methods[0].runs[0]
    subsets = _subsets(first)
    return {
        "study": first.study,
        "label": first.label,
        "settings": first.settings,
        "episodes_per_run": len(first.values),
        "methods": {
            method.name: {
                **method_summary([run.values for run in method.runs]),
                "files": [str(run.path) for run in method.runs],
                "per_run_success": [run.success for run in method.runs],
                "parts": {
                    name: method_summary([select(run) for run in method.runs]) for name, select in subsets.items()
                },
            }
            for method in methods
        },
        "differences": [_difference(methods[0], second, subsets) for second in methods[1:]],
        **_definition_entries(first),
    }


def _definition_entries(first: StudyResult) -> dict[str, dict[str, str]]:
    """The `definitions` of the measures, and `not_measured` with the reason for one that the task lacks."""
    if first.measures_interaction:
        return {"definitions": DEFINITIONS}
    reason = first.not_measured.get("interaction_force", "left out: no result has it")
    definitions = {name: text for name, text in DEFINITIONS.items() if name != "interaction_mean"}
    return {"definitions": definitions, "not_measured": {"interaction_mean": reason}}


def _subsets(first: StudyResult) -> dict[str, Subset]:
    """Selects episodes by number of obstacles and, in a partner study, by kind of partner."""
    subsets: dict[str, Subset] = {}
    for count in sorted({row["obstacles"] for row in first.rows if "obstacles" in row}):
        name = f"{count} obstacle{'s' * (count != 1)}"
        subsets[name] = lambda run, count=count: subset(run, "obstacles", count)
    for kind in dict.fromkeys(row["partner"] for row in first.rows if "partner" in row):
        subsets[f"partner {kind}"] = lambda run, kind=kind: subset(run, "partner", kind)
    return subsets


def method_summary(runs: Sequence[Mapping[EpisodeKey, Metrics]]) -> dict[str, Any]:
    """Success, time of successes and interaction of a method from the episodes of its training runs.

    Each has its mean over runs, the standard error between runs and the largest value; the standard error of the
    success of one run is binomial (`standard_error_of`).
    """
    success = between_runs(_run_means(runs, "success"))
    error, source = success["standard_error"], "between runs"
    if error is None:
        p = success["mean"]
        error, source = float(np.sqrt(p * (1 - p) / len(runs[0]))), "binomial, one run"
    return {
        "success": {**success, "standard_error": error, "standard_error_of": source, "episodes": len(runs[0])},
        "time_s": between_runs(_run_means(runs, "time_s")),
        "interaction_mean": between_runs(_run_means(runs, "interaction_mean")),
    }


def _run_means(runs: Sequence[Mapping[EpisodeKey, Metrics]], name: str) -> list[float]:
    means = []
    for run in runs:
        values = np.array([metrics.get(name, np.nan) for metrics in run.values()])
        finite = values[np.isfinite(values)]
        means.append(float(finite.mean()) if len(finite) else float("nan"))
    return means


def _difference(first: Method, second: Method, subsets: Mapping[str, Subset]) -> dict[str, Any]:
    result: dict[str, Any] = {
        "first": first.name,
        "second": second.name,
        **paired_differences(mean_over([r.values for r in first.runs]), mean_over([r.values for r in second.runs])),
        "between_runs": welch([run.success for run in first.runs], [run.success for run in second.runs]),
        "mcnemar": None,
    }
    a, b = first.runs[0], second.runs[0]
    # McNemar's test needs independent pairs; several episodes on one start are not.
    starts = {(key[0], key[2]) for key in a.values}
    if len(first.runs) == len(second.runs) == 1 and len(starts) == len(a.values):
        successes = [(values["success"] > 0, b.values[key]["success"] > 0) for key, values in a.values.items()]
        result["mcnemar"] = mcnemar_exact([x for x, _ in successes], [y for _, y in successes])
    result["parts"] = {
        name: paired_differences(
            mean_over([select(r) for r in first.runs]), mean_over([select(r) for r in second.runs])
        )
        for name, select in subsets.items()
    }
    return result
