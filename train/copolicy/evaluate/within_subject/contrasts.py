"""Pairwise contrasts of conditions within units, with Holm's correction over all contrasts of a question."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from copolicy.dataset.arrays import Array

from .measurements import Measurements


def contrasts(measurements: Measurements) -> dict[str, list[dict[str, Any]]]:
    """All contrasts of each question; Holm's correction covers the contrasts of one question.

    Questions: each factor (over the levels of the second), and with two factors the simple effects of each factor at
    every level of the second.
    """
    questions = {factor: _pairs(measurements.over(factor), levels) for factor, levels in measurements.factors.items()}
    if len(measurements.factors) == 2:
        for axis, factor in enumerate(measurements.factors):
            second = list(measurements.factors)[1 - axis]
            found = []
            for k, level in enumerate(measurements.factors[second]):
                values = np.take(measurements.values, k, axis=2 - axis)
                found += [{"at": level, **pair} for pair in _pairs(values, measurements.factors[factor])]
            questions[f"{factor} at each {second}"] = found
    for question in questions.values():
        for name in ("paired_t", "wilcoxon"):
            holm([pair[name] for pair in question])
    return questions


def tukey(values: Array, names: Sequence[str]) -> list[dict[str, Any]]:
    """Tukey's honestly significant differences on the error term of the one-way ANOVA, for every pair of conditions.

    Args:
        values: `(n, k)` units x conditions.
    """
    n, k = values.shape
    residual = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean() if n else values
    error = float((residual**2).sum()) if n > 1 and k > 1 else 0.0
    means = values.mean(axis=0)
    degrees = (n - 1) * (k - 1)
    scale = float(np.sqrt(error / degrees / n)) if degrees and error > 0 else 0.0
    critical = float(stats.studentized_range.ppf(0.95, k, degrees)) if scale else 0.0
    differences = []
    for a, b in combinations(range(k), 2):
        difference = float(means[a] - means[b])
        test = None
        if scale:
            p = float(stats.studentized_range.sf(abs(difference) / scale, k, degrees))
            margin = critical * scale
            test = {"p": p, "interval_95": [difference - margin, difference + margin]}
        differences.append({"first": names[a], "second": names[b], "difference": difference, "tukey": test})
    return differences


def holm(tests: Sequence[dict[str, Any] | None]) -> None:
    """Adds `p_holm` to the tests of one question (Holm, 1979); None stands for a test without spread."""
    found = sorted((test for test in tests if test is not None), key=lambda test: test["p"])
    adjusted = 0.0
    for place, test in enumerate(found):
        adjusted = max(adjusted, test["p"] * (len(found) - place))
        test["p_holm"] = min(1.0, adjusted)


def _pairs(values: Array, names: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {"first": names[a], "second": names[b], **_paired(values[:, a], values[:, b])}
        for a, b in combinations(range(values.shape[1]), 2)
    ]


def _paired(first: Array, second: Array) -> dict[str, Any]:
    """Difference of two conditions with paired t test, Wilcoxon's test and Hedges' g (pooled standard deviation)."""
    difference = first - second
    n = len(difference)
    result: dict[str, Any] = {"difference": float(difference.mean()), "paired_t": None, "wilcoxon": None}
    if n < 2 or np.ptp(difference) < 1e-12:
        return {**result, "hedges_g": None}
    test = stats.ttest_rel(first, second)
    low, high = test.confidence_interval(0.95)  # pyright: ignore[reportAttributeAccessIssue]
    result["paired_t"] = {
        "t": float(test.statistic),  # pyright: ignore[reportAttributeAccessIssue]
        "df": n - 1,
        "p": float(test.pvalue),  # pyright: ignore[reportAttributeAccessIssue]
        "interval_95": [float(low), float(high)],
    }
    rank = stats.wilcoxon(difference, zero_method="zsplit")
    result["wilcoxon"] = {"statistic": float(rank.statistic), "p": float(rank.pvalue)}  # pyright: ignore
    pooled = float(np.sqrt((first.var(ddof=1) + second.var(ddof=1)) / 2))
    correction = 1 - 3 / (4 * (2 * n - 2) - 1)
    return {**result, "hedges_g": float(difference.mean() / pooled * correction) if pooled > 0 else None}
