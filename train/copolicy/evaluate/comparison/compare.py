"""Methods side by side, and each against the first."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .paired import BOOTSTRAP, Key, Values, between_runs, mcnemar_exact, mean_over, paired_differences, welch
from .results import Method, Result, subset

DEFINITIONS = {
    "success": "mean over training runs of a run's share of successes; standard error between runs (with one run: "
    "binomial over its episodes, which says nothing about other training seeds)",
    "time_s": "mean over runs of a run's mean time of successes",
    "interaction_mean": "mean over runs of the mean over episodes of |interaction force|, full forces",
    "difference": "first method minus the second on the same starts, each episode the mean over a method's runs",
    "bootstrap_95": f"{BOOTSTRAP}; the training runs are taken as they are",
    "between_runs": "Welch's t interval of the difference between training runs, with two or more of each method",
    "mcnemar": "exact, two-sided, with one run of each method and one episode a start",
}

Part = Callable[[Result], dict[Key, Values]]


def compare(methods: Sequence[Method]) -> dict[str, Any]:
    """Everything about some methods of one protocol, JSON-able."""
    first = methods[0].runs[0]
    parts = _parts(first)
    return {
        "study": first.study,
        "label": first.label,
        "settings": first.settings,
        "episodes_per_run": len(first.values),
        "methods": {
            method.name: {
                **_summary([run.values for run in method.runs]),
                "files": [str(run.path) for run in method.runs],
                "per_run_success": [run.success for run in method.runs],
                "parts": {name: _summary([part(run) for run in method.runs]) for name, part in parts.items()},
            }
            for method in methods
        },
        "differences": [_difference(methods[0], other, parts) for other in methods[1:]],
        **_definitions(first),
    }


def _definitions(first: Result) -> dict[str, dict[str, str]]:
    """What the measures mean; the reason of one that the task lacks, where the result has it, stands apart."""
    if first.measures_interaction:
        return {"definitions": DEFINITIONS}
    reason = first.not_measured.get("interaction_force", "left out: no result has it")
    definitions = {name: text for name, text in DEFINITIONS.items() if name != "interaction_mean"}
    return {"definitions": definitions, "not_measured": {"interaction_mean": reason}}


def _parts(first: Result) -> dict[str, Part]:
    """By number of obstacles and, with partners, by kind."""
    parts: dict[str, Part] = {}
    for count in sorted({row["obstacles"] for row in first.rows if "obstacles" in row}):
        name = f"{count} obstacle{'s' * (count != 1)}"
        parts[name] = lambda run, count=count: subset(run, "obstacles", count)
    for kind in dict.fromkeys(row["partner"] for row in first.rows if "partner" in row):
        parts[f"partner {kind}"] = lambda run, kind=kind: subset(run, "partner", kind)
    return parts


def _summary(runs: Sequence[Mapping[Key, Values]]) -> dict[str, Any]:
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


def _run_means(runs: Sequence[Mapping[Key, Values]], name: str) -> list[float]:
    means = []
    for run in runs:
        values = np.array([one.get(name, np.nan) for one in run.values()])
        finite = values[np.isfinite(values)]
        means.append(float(finite.mean()) if len(finite) else float("nan"))
    return means


def _difference(one: Method, other: Method, parts: Mapping[str, Part]) -> dict[str, Any]:
    result: dict[str, Any] = {
        "first": one.name,
        "second": other.name,
        **paired_differences(mean_over([r.values for r in one.runs]), mean_over([r.values for r in other.runs])),
        "between_runs": welch([run.success for run in one.runs], [run.success for run in other.runs]),
        "mcnemar": None,
    }
    a, b = one.runs[0], other.runs[0]
    # More episodes on a start are no independent pairs.
    starts = {(key[0], key[2]) for key in a.values}
    if len(one.runs) == len(other.runs) == 1 and len(starts) == len(a.values):
        successes = [(values["success"] > 0, b.values[key]["success"] > 0) for key, values in a.values.items()]
        result["mcnemar"] = mcnemar_exact([x for x, _ in successes], [y for _, y in successes])
    result["parts"] = {
        name: paired_differences(mean_over([part(r) for r in one.runs]), mean_over([part(r) for r in other.runs]))
        for name, part in parts.items()
    }
    return result
