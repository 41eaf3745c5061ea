"""Means over partners of values of episodes, and their uncertainty from a bootstrap over maps."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array

from ..comparison.paired import REPLICATES

Values = Mapping[str, Mapping[str, Sequence[tuple[str, float]]]]
"""By robot and partner: the map and the value of each episode that has one."""


class Resampled(NamedTuple):
    """Mean of the episodes of a robot with a partner, or a difference of two.

    Attributes:
        replicates: `(REPLICATES,)`; NaN where no map with a value was drawn.
        maps: number of maps with a value.
    """

    mean: float
    replicates: Array
    maps: int

    def minus(self, other: "Resampled") -> "Resampled":
        """The difference, drawing the same maps."""
        return Resampled(self.mean - other.mean, self.replicates - other.replicates, min(self.maps, other.maps))


class MapBootstrap(NamedTuple):
    """Means and their replicates; each replicate draws maps with all episodes of a map together.

    Attributes:
        maps: largest number of maps of a partner.
        known: whether each partner has several maps. With one every replicate is the same, which is no uncertainty of
            zero.
        resampled: by robot, and by partner with which it has a value.
    """

    maps: int
    known: bool
    resampled: Mapping[str, Mapping[str, Resampled]]

    @classmethod
    def of(cls, values: Values, maps: Mapping[str, Sequence[str]], seed: int = 0) -> "MapBootstrap":
        """Draws the same maps for all robots, and for all partners with the same maps.

        Args:
            maps: of each partner.
        """
        rng = np.random.default_rng(seed)
        weights: dict[tuple[str, ...], Array] = {}
        resampled: dict[str, dict[str, Resampled]] = {robot: {} for robot in values}
        for partner, names in maps.items():
            drawn = tuple(names)
            if drawn not in weights:
                uniform = np.full(len(drawn), 1 / len(drawn))
                weights[drawn] = rng.multinomial(len(drawn), uniform, size=REPLICATES).astype(float)
            for robot, by_partner in values.items():
                if by_partner.get(partner):
                    resampled[robot][partner] = _resampled(by_partner[partner], drawn, weights[drawn])
        return cls(max(map(len, weights)), min(map(len, weights)) > 1, resampled)

    def totals(self, robot: str) -> Array:
        """`(REPLICATES,)` replicates of the mean over the partners with which the robot has a value."""
        return _totals(self.resampled[robot].values())

    def estimate(self, robot: str, partner: str | None = None) -> dict[str, Any]:
        """Mean, standard error and 95 % interval of a robot, over the partners with which it has a value, or of one."""
        by_partner = self.resampled[robot]
        return self._estimate(by_partner.values() if partner is None else [by_partner[partner]])

    def difference(self, robot: str, other: str) -> dict[str, Any] | None:
        """Mean of a robot minus that of another, with its size in standard errors.

        Returns:
            Over the partners with which both have a value: others would count as a difference of the robots. None
            without any.
        """
        others = self.resampled[other]
        parts = [part.minus(others[name]) for name, part in self.resampled[robot].items() if name in others]
        if not parts:
            return None
        found = self._estimate(parts)
        error = found["standard_error"]
        return {**found, "standard_errors": found["mean"] / error if error else None}

    def differences(self, robots: Sequence[str], others: Sequence[str]) -> dict[str, dict[str, Any]]:
        """`difference` of each robot that is none of `others` to each of them, where there is one."""
        return {
            robot: {other: found for other in others if (found := self.difference(robot, other)) is not None}
            for robot in robots
            if robot not in others
        }

    def _estimate(self, parts: Collection[Resampled]) -> dict[str, Any]:
        mean = float(np.mean([part.mean for part in parts]))
        if not self.known or max(part.maps for part in parts) < 2:
            return {"mean": mean, "standard_error": None, "bootstrap_95": None}
        totals = _totals(parts)
        drawn = totals[~np.isnan(totals)]
        low, high = np.quantile(drawn, (0.025, 0.975))
        return {"mean": mean, "standard_error": float(drawn.std()), "bootstrap_95": [float(low), float(high)]}


def _resampled(values: Sequence[tuple[str, float]], maps: tuple[str, ...], weights: Array) -> Resampled:
    """Of the episodes of a robot with a partner.

    Args:
        weights: `(REPLICATES, maps)` how often each map is drawn.
    """
    positions = [maps.index(name) for name, _ in values]
    sums = np.bincount(positions, [value for _, value in values], minlength=len(maps))
    episodes = np.bincount(positions, minlength=len(maps))
    with np.errstate(invalid="ignore"):
        replicates = (weights @ sums) / (weights @ episodes)
    return Resampled(float(sums.sum() / episodes.sum()), replicates, len(set(positions)))


def _totals(parts: Collection[Resampled]) -> Array:
    """`(REPLICATES,)` replicates of the mean over partners, of those with a value in the replicate."""
    values = np.array([part.replicates for part in parts])
    known = ~np.isnan(values)
    with np.errstate(invalid="ignore"):
        return np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)
