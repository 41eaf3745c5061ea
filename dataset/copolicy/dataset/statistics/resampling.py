"""Chance: bootstrap over episodes or pairs, permutation within configurations, circular shifts in time."""

from typing import Any

import numpy as np

from .estimate import Estimate

MIN_CLUSTERS = 5
"""Pairs that it takes to draw pairs anew; with fewer, episodes are drawn, and the interval tells less."""


class Bootstrap:
    """How often each episode is drawn in each replicate.

    Pairs are drawn with all their episodes where there are at least `MIN_CLUSTERS`, since episodes of a pair are
    alike; else episodes are drawn.

    Attributes:
        weights: `(B, E)` how often each episode is in each replicate.
        resampled: `pairs` or `episodes`.
    """

    def __init__(self, pairs: np.ndarray, replicates: int, rng: np.random.Generator):
        names, cluster = np.unique(pairs, return_inverse=True)
        self.resampled = "pairs" if len(names) >= MIN_CLUSTERS else "episodes"
        if self.resampled == "pairs":
            drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=replicates)
            self.weights = drawn[:, cluster].astype(np.float32)
        else:
            count = len(cluster)
            self.weights = rng.multinomial(count, np.full(count, 1 / count), size=replicates).astype(np.float32)

    def ratio(self, numerator: np.ndarray, denominator: np.ndarray) -> tuple[float | None, tuple[float, float] | None]:
        """Sum of one value of the episodes `(E,)` over the sum of another, and its interval."""
        total = denominator.sum()
        if not total:
            return None, None
        value = float(numerator.sum() / total)
        below = self.weights @ denominator
        drawn = below != 0
        return value, interval(value, (self.weights[drawn] @ numerator) / below[drawn])

    def estimate(
        self, numerator: np.ndarray, denominator: np.ndarray, unit: str, definition: str, episodes: int, **more: Any
    ) -> Estimate:
        """The ratio as an estimate; `more` are further fields of it."""
        value, bounds = self.ratio(numerator, denominator)
        return Estimate(value, unit, definition, episodes, bounds, self.resampled, **more)

    def mean(self, values: np.ndarray) -> tuple[float | None, tuple[float, float] | None]:
        """Mean of a value of the episodes `(E,)` over those where it is finite, and its interval."""
        finite = np.isfinite(values)
        return self.ratio(np.where(finite, values, 0.0), finite.astype(float))


def interval(value: float, replicates: np.ndarray, low: float = -np.inf, high: float = np.inf) -> tuple[float, float]:
    """95 percent interval from bootstrap replicates `(B,)`, moved so that their mean lies on the estimate.

    Entropies, divergences and shares of variance of a resample are biased against those of the sample as those are
    against the truth; without the shift the interval could miss its own estimate.
    """
    if not len(replicates):
        return (float("nan"), float("nan"))
    quantiles = np.quantile(replicates, (0.025, 0.975)) + value - replicates.mean()
    lower, upper = np.clip(quantiles, low, high)
    return float(min(lower, value)), float(max(upper, value))


def permuted_within(labels: np.ndarray, strata: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """`labels` `(E,)` shuffled among the episodes of each stratum."""
    order = np.argsort(strata, kind="stable")
    shuffled = np.lexsort((rng.random(len(labels)), strata))
    result = np.empty_like(labels)
    result[order] = labels[shuffled]
    return result


def drawn_within(groups: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """`(E,)` how often each episode is drawn when those of each group `(E,)` are drawn anew."""
    order = np.argsort(groups, kind="stable")
    sizes = np.bincount(groups)
    begin = np.repeat(np.cumsum(sizes) - sizes, sizes)
    places = begin + (rng.random(len(groups)) * np.repeat(sizes, sizes)).astype(int)
    return np.bincount(order[places], minlength=len(groups)).astype(float)


def exchangeable(labels: np.ndarray, strata: np.ndarray) -> int:
    """Episodes in strata that hold more than one label: those that `permuted_within` can move."""
    mixed = [stratum for stratum in np.unique(strata) if len(np.unique(labels[strata == stratum])) > 1]
    return int(np.isin(strata, mixed).sum())


def circular_shift(starts: np.ndarray, lengths: np.ndarray, least: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of frames `(N,)` that turn each episode around in time by a random number of frames.

    Args:
        least: smallest shift in either direction, frames; an episode shorter than two of it is turned by half.
    """
    room = np.maximum(lengths - 2 * least, 1)
    shifts = np.where(lengths > 2 * least, least + rng.integers(room), lengths // 2)
    offset = np.arange(int(lengths.sum())) - np.repeat(starts, lengths)
    turned = (offset + np.repeat(shifts, lengths)) % np.repeat(lengths, lengths)
    return turned + np.repeat(starts, lengths)
