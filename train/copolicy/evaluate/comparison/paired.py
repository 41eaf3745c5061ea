"""Statistics of paired comparisons: differences of two methods on the same starts, intervals and tests."""

import math
import warnings
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from copolicy.dataset.arrays import Array
from copolicy.dataset.scenarios import base_name

REPLICATES = 10_000
BOOTSTRAP = f"percentile bootstrap over maps, {REPLICATES} replicates, all episodes of a map drawn together"

METRICS = ("success", "time_s", "interaction_mean", "interaction_p95", "robot_share", "deadlock_s")
"""Compared columns, if all rows have them: success (0 or 1), time of successes (s), forces, proportion, time (s)."""

EpisodeKey = tuple[Hashable, ...]
Metrics = dict[str, float]


def episode_key(row: Mapping[str, Any]) -> EpisodeKey:
    """Identifies an episode across results: position in the list of starts, map, orientation, partner, repeat."""
    return row["map_index"], row["map_id"], row.get("start_theta"), row.get("partner", ""), row["repeat"]


def episode_values(rows: Iterable[Mapping[str, Any]]) -> dict[EpisodeKey, Metrics]:
    """Metrics of each episode; the time of a failure is nan, since it is no time to completion."""
    metrics_by_episode = {}
    for row in rows:
        metrics = {name: float(row[name]) for name in METRICS if row.get(name) is not None}
        if not row["success"]:
            metrics["time_s"] = math.nan
        metrics_by_episode[episode_key(row)] = metrics
    return metrics_by_episode


def mean_over(runs: Sequence[Mapping[EpisodeKey, Metrics]]) -> dict[EpisodeKey, Metrics]:
    """Mean of each metric over several runs of the same episodes; nan values are left out."""
    first = runs[0]
    return {
        key: {name: _finite_mean([run[key][name] for run in runs]) for name in values} for key, values in first.items()
    }


def paired_differences(
    first: Mapping[EpisodeKey, Metrics], second: Mapping[EpisodeKey, Metrics], *, seed: int = 0
) -> dict[str, Any]:
    """Mean of `first - second` for each metric that both have, over the episodes in which both are finite.

    Raises:
        KeyError: `second` lacks an episode of `first`.
    """
    result: dict[str, Any] = {}
    clusters = [base_name(str(key[1])) for key in first]  # start orientations of one map form one cluster
    for name in METRICS:
        if all(name in metrics for metrics in (*first.values(), *second.values())):
            differences = np.array([metrics[name] - second[key][name] for key, metrics in first.items()])
            result[name] = clustered_mean(differences, clusters, seed)
    return result


def clustered_mean(values: Array, clusters: Sequence[Hashable], seed: int = 0) -> dict[str, Any]:
    """Mean of values `(n,)` with standard error and 95 % interval of a bootstrap over clusters; nan is left out."""
    finite = np.isfinite(values)
    if not finite.any():
        return {"mean": None, "standard_error": None, "bootstrap_95": None, "pairs": 0, "maps": 0}
    indices = {name: k for k, name in enumerate(dict.fromkeys(clusters))}
    index = np.array([indices[name] for name in clusters])[finite]
    used = np.unique(index)
    sums = np.bincount(index, values[finite], minlength=len(indices))[used]
    counts = np.bincount(index, minlength=len(indices))[used]
    mean = float(sums.sum() / counts.sum())
    interval = error = None
    if len(used) > 1:
        rng = np.random.default_rng(seed)
        weights = rng.multinomial(len(used), np.full(len(used), 1 / len(used)), size=REPLICATES)
        means = (weights @ sums) / (weights @ counts)
        error, interval = float(means.std()), np.quantile(means, (0.025, 0.975)).tolist()
    return {
        "mean": mean,
        "standard_error": error,
        "bootstrap_95": interval,
        "pairs": int(finite.sum()),
        "maps": len(used),
    }


def mcnemar_exact(first: Sequence[bool], second: Sequence[bool]) -> dict[str, Any]:
    """McNemar's exact test of paired successes.

    p is two-sided, from the binomial distribution of the discordant pairs (McNemar 1947, exact version).
    """
    only_first = sum(a and not b for a, b in zip(first, second, strict=True))
    only_second = sum(b and not a for a, b in zip(first, second, strict=True))
    discordant = only_first + only_second
    p = float(stats.binomtest(only_first, discordant, 0.5).pvalue) if discordant else 1.0
    return {"only_first": int(only_first), "only_second": int(only_second), "p": p}


def between_runs(values: Sequence[float]) -> dict[str, Any]:
    """Mean over training runs with the standard error between runs, which is None for a single run."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return {"mean": None, "standard_error": None, "max": None, "runs": 0}
    error = float(np.std(finite, ddof=1) / math.sqrt(len(finite))) if len(finite) > 1 else None
    return {"mean": float(np.mean(finite)), "standard_error": error, "max": max(finite), "runs": len(finite)}


def welch(first: Sequence[float], second: Sequence[float]) -> dict[str, Any] | None:
    """Welch's t interval and test of the difference between two sets of training runs.

    None if a set has fewer than two runs, a value is not finite, or neither set has any spread.
    """
    if min(len(first), len(second)) < 2 or not np.isfinite([*first, *second]).all():
        return None
    if np.ptp(first) == np.ptp(second) == 0:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", RuntimeWarning
        )  # scipy warns if one set has no spread, which Welch's test allows
        result = stats.ttest_ind(first, second, equal_var=False)
    low, high = result.confidence_interval(0.95)  # pyright: ignore[reportAttributeAccessIssue]
    return {"interval_95": [float(low), float(high)], "p": float(result.pvalue)}  # pyright: ignore


def _finite_mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite)) if finite else math.nan
