"""Statistics of a within-subject study: repeated-measures ANOVA, Tukey's comparisons, and rank tests for ratings."""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from copolicy.dataset.arrays import Array


def anova(values: Array) -> dict[str, Any] | None:
    """One-way repeated-measures ANOVA.

    Args:
        values: `(n, k)` participants x conditions.

    Returns:
        F, its degrees of freedom, p, p with Greenhouse and Geisser's correction and its epsilon, and partial eta
        squared; None for fewer than two participants or conditions, or if the error sum of squares is zero.
    """
    n, k = values.shape
    if n < 2 or k < 2:
        return None
    conditions, error = _sums_of_squares(values)
    first, second = k - 1, (n - 1) * (k - 1)
    if error <= 1e-12 * (conditions + error) or error == 0:
        return None
    f = float((conditions / first) / (error / second))
    epsilon = _greenhouse_geisser(values)
    return {
        "F": f,
        "df": [first, second],
        "p": float(stats.f.sf(f, first, second)),
        "epsilon": epsilon,
        "p_greenhouse_geisser": float(stats.f.sf(f, epsilon * first, epsilon * second)),
        "partial_eta_squared": float(conditions / (conditions + error)),
        "participants": n,
    }


def tukey(values: Array, names: Sequence[str]) -> list[dict[str, Any]]:
    """Tukey's honestly significant differences on the error term of `anova`, for every pair of conditions."""
    n, k = values.shape
    _, error = _sums_of_squares(values) if n > 1 and k > 1 else (0.0, 0.0)
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


def rank_test(values: Array) -> dict[str, Any] | None:
    """Friedman's test of ratings `(n, k)`, or Wilcoxon's for two conditions; None if there is nothing to rank."""
    n, k = values.shape
    if n < 2 or k < 2 or not np.ptp(values, axis=1).any():
        return None
    if k == 2:
        result = stats.wilcoxon(values[:, 0], values[:, 1], zero_method="zsplit")
        return {"test": "Wilcoxon signed rank", "statistic": float(result.statistic), "p": float(result.pvalue)}  # pyright: ignore
    result = stats.friedmanchisquare(*values.T)
    return {"test": "Friedman", "statistic": float(result.statistic), "p": float(result.pvalue)}


def _sums_of_squares(values: Array) -> tuple[float, float]:
    n = len(values)
    grand = values.mean()
    conditions = n * float(((values.mean(axis=0) - grand) ** 2).sum())
    residual = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + grand
    return conditions, float((residual**2).sum())


def _greenhouse_geisser(values: Array) -> float:
    k = values.shape[1]
    covariance = np.cov(values, rowvar=False)
    centred = covariance - covariance.mean(axis=0) - covariance.mean(axis=1, keepdims=True) + covariance.mean()
    return float(np.clip(np.trace(centred) ** 2 / ((k - 1) * (centred**2).sum()), 1 / (k - 1), 1.0))
