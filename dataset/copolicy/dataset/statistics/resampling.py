"""Resampling: bootstrap over episodes or pairs, permutation within configurations, circular shifts in time."""

from typing import Any

import numpy as np

from ..arrays import Array
from .estimate import Estimate

MIN_CLUSTERS = 5
"""Smallest number of pairs to resample pairs; with fewer, episodes are resampled, and the interval is too narrow."""


class Bootstrap:
    """Bootstrap replicates as multiplicities of the episodes.

    Episodes of a pair are correlated: pairs are resampled with all their episodes if there are at least `MIN_CLUSTERS`
    pairs, else episodes.

    Attributes:
        weights: `(B, E)` multiplicity of each episode in each replicate.
        resampled: `pairs` or `episodes`.
    """

    def __init__(self, pairs: Array, replicates: int, rng: np.random.Generator):
        names, cluster = np.unique(pairs, return_inverse=True)
        self.resampled = "pairs" if len(names) >= MIN_CLUSTERS else "episodes"
        if self.resampled == "pairs":
            pair_weights = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=replicates)
            self.weights = pair_weights[:, cluster].astype(np.float32)
        else:
            count = len(cluster)
            self.weights = rng.multinomial(count, np.full(count, 1 / count), size=replicates).astype(np.float32)

    def ratio(self, numerator: Array, denominator: Array) -> tuple[float | None, tuple[float, float] | None]:
        """Ratio of the sums of two values `(E,)` of the episodes, and its interval; None if the denominator is 0."""
        total = denominator.sum()
        if not total:
            return None, None
        value = float(numerator.sum() / total)
        denominators = self.weights @ denominator
        nonzero = denominators != 0
        return value, interval(value, (self.weights[nonzero] @ numerator) / denominators[nonzero])

    def estimate(
        self, numerator: Array, denominator: Array, unit: str, definition: str, episodes: int, **more: Any
    ) -> Estimate:
        """The ratio as an `Estimate`; `more` are further fields of `Estimate`."""
        value, bounds = self.ratio(numerator, denominator)
        return Estimate(value, unit, definition, episodes, bounds, self.resampled, **more)

    def mean(self, values: Array) -> tuple[float | None, tuple[float, float] | None]:
        """Mean over the finite values `(E,)` of the episodes, and its interval."""
        finite = np.isfinite(values)
        return self.ratio(np.where(finite, values, 0.0), finite.astype(float))


def interval(value: float, replicates: Array, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
    """95 percent interval from bootstrap replicates `(B,)`, shifted so that their mean equals the estimate.

    Entropies, divergences and explained variances of resamples are biased relative to those of the sample; without the
    shift the interval may not contain the estimate.
    """
    if not len(replicates):
        return (float("nan"), float("nan"))
    quantiles = np.quantile(replicates, (0.025, 0.975)) + value - replicates.mean()
    lower, upper = np.clip(quantiles, low, high)
    return float(min(lower, value)), float(max(upper, value))


def permuted_within(labels: Array, strata: Array, rng: np.random.Generator) -> Array:
    """`labels` `(E,)` shuffled among the episodes of each stratum."""
    order = np.argsort(strata, kind="stable")
    shuffled = np.lexsort((rng.random(len(labels)), strata))
    result = np.empty_like(labels)
    result[order] = labels[shuffled]
    return result


def drawn_within(groups: Array, rng: np.random.Generator) -> Array:
    """`(E,)` multiplicity of each episode when the episodes of each group `(E,)` are resampled."""
    order = np.argsort(groups, kind="stable")
    sizes = np.bincount(groups)
    group_starts = np.repeat(np.cumsum(sizes) - sizes, sizes)
    draws = group_starts + (rng.random(len(groups)) * np.repeat(sizes, sizes)).astype(int)
    return np.bincount(order[draws], minlength=len(groups)).astype(float)


def exchangeable(labels: Array, strata: Array) -> int:
    """Number of episodes in strata with more than one label, whose labels `permuted_within` can exchange."""
    mixed = [stratum for stratum in np.unique(strata) if len(np.unique(labels[strata == stratum])) > 1]
    return int(np.isin(strata, mixed).sum())


def circular_shift(starts: Array, lengths: Array, min_shift: int, rng: np.random.Generator) -> Array:
    """Frame indices `(N,)` that shift each episode circularly in time by a random number of frames.

    Args:
        min_shift: smallest shift in both directions, frames; an episode shorter than twice that is shifted by half.
    """
    choices = np.maximum(lengths - 2 * min_shift, 1)
    shifts = np.where(lengths > 2 * min_shift, min_shift + rng.integers(choices), lengths // 2)
    offset = np.arange(int(lengths.sum())) - np.repeat(starts, lengths)
    shifted = (offset + np.repeat(shifts, lengths)) % np.repeat(lengths, lengths)
    return shifted + np.repeat(starts, lengths)
