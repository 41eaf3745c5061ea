"""Differences between two methods on the same episodes, and how sure they are."""

import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats

from copolicy.dataset.scenarios import base_name

REPLICATES = 10_000
BOOTSTRAP = f"percentile bootstrap over maps, {REPLICATES} replicates, all episodes of a map drawn together"

METRICS = ("success", "time_s", "interaction_mean", "interaction_p95", "robot_share", "deadlock_s")
"""What is compared, where all rows have it: success as 0 or 1, time of successes only, s, forces, shares."""

Key = tuple[Hashable, ...]
Values = dict[str, float]


def episode_key(row: Mapping[str, Any]) -> Key:
    """What makes two episodes the same episode: place in the list of starts, map, partner, repeat."""
    return row["map_index"], row["map_id"], row.get("start_theta"), row.get("partner", ""), row["repeat"]


def episode_values(rows: Iterable[Mapping[str, Any]]) -> dict[Key, Values]:
    """Metrics of each episode; the time of a failure is nan, since it says nothing about how fast a robot is."""
    found = {}
    for row in rows:
        values = {name: float(row[name]) for name in METRICS if row.get(name) is not None}
        if not row["success"]:
            values["time_s"] = math.nan
        found[episode_key(row)] = values
    return found


def mean_over(runs: Sequence[Mapping[Key, Values]]) -> dict[Key, Values]:
    """Mean of each metric over several runs of the same episodes, those where it is nan left out."""
    first = runs[0]
    return {
        key: {name: _finite_mean([run[key][name] for run in runs]) for name in values} for key, values in first.items()
    }


def paired_differences(one: Mapping[Key, Values], other: Mapping[Key, Values], seed: int = 0) -> dict[str, Any]:
    """Mean of `one - other` for every metric that both have, over the episodes where both are finite.

    Raises:
        KeyError: `other` lacks an episode of `one`.
    """
    result: dict[str, Any] = {}
    clusters = [base_name(str(key[1])) for key in one]  # start orientations of one map are no maps of their own
    for name in METRICS:
        if all(name in values for values in (*one.values(), *other.values())):
            differences = np.array([values[name] - other[key][name] for key, values in one.items()])
            result[name] = clustered_mean(differences, clusters, seed)
    return result


def clustered_mean(values: np.ndarray, clusters: Sequence[Hashable], seed: int = 0) -> dict[str, Any]:
    """Mean of values `(n,)` with a 95 % interval from drawing clusters anew; nan values are left out."""
    finite = np.isfinite(values)
    if not finite.any():
        return {"mean": None, "bootstrap_95": None, "pairs": 0, "maps": 0}
    names = {name: k for k, name in enumerate(dict.fromkeys(clusters))}
    place = np.array([names[name] for name in clusters])[finite]
    used = np.unique(place)
    sums = np.bincount(place, values[finite], minlength=len(names))[used]
    counts = np.bincount(place, minlength=len(names))[used]
    mean = float(sums.sum() / counts.sum())
    interval = None
    if len(used) > 1:
        rng = np.random.default_rng(seed)
        weights = rng.multinomial(len(used), np.full(len(used), 1 / len(used)), size=REPLICATES)
        low, high = np.quantile((weights @ sums) / (weights @ counts), (0.025, 0.975))
        interval = [float(low), float(high)]
    return {"mean": mean, "bootstrap_95": interval, "pairs": int(finite.sum()), "maps": len(used)}


def mcnemar_exact(one: Sequence[bool], other: Sequence[bool]) -> dict[str, Any]:
    """McNemar's exact test on paired successes: do the two differ in how often they alone succeed?

    p is two-sided, from the binomial distribution of the discordant pairs (McNemar 1947, exact version).
    """
    only_one = sum(a and not b for a, b in zip(one, other, strict=True))
    only_other = sum(b and not a for a, b in zip(one, other, strict=True))
    discordant = only_one + only_other
    p = float(stats.binomtest(only_one, discordant, 0.5).pvalue) if discordant else 1.0
    return {"only_first": int(only_one), "only_second": int(only_other), "p": p}


def between_runs(values: Sequence[float]) -> dict[str, Any]:
    """Mean over training runs with the standard error between them; None with a single one."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return {"mean": None, "standard_error": None, "max": None, "runs": 0}
    error = float(np.std(finite, ddof=1) / math.sqrt(len(finite))) if len(finite) > 1 else None
    return {"mean": float(np.mean(finite)), "standard_error": error, "max": max(finite), "runs": len(finite)}


def welch(one: Sequence[float], other: Sequence[float]) -> dict[str, Any] | None:
    """Welch's t interval and test of the difference between two sets of training runs; None with fewer than two."""
    if min(len(one), len(other)) < 2 or not np.isfinite([*one, *other]).all():
        return None
    if np.ptp(one) == np.ptp(other) == 0:  # no spread, no test
        return None
    result = stats.ttest_ind(one, other, equal_var=False)
    low, high = result.confidence_interval(0.95)  # pyright: ignore[reportAttributeAccessIssue]
    return {"interval_95": [float(low), float(high)], "p": float(result.pvalue)}  # pyright: ignore


def _finite_mean(values: Sequence[float]) -> float:
    finite = [value for value in values if math.isfinite(value)]
    return float(np.mean(finite)) if finite else math.nan
