"""Means over partners of values of episodes, and their uncertainty from a bootstrap over maps."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array

from ..comparison.paired import REPLICATES

Values = Mapping[str, Mapping[str, Sequence[tuple[str, float]]]]
"""By robot and partner: the map and the value of each episode that has one."""


class MapBootstrap(NamedTuple):
    """Means and their replicates; each replicate draws maps with all episodes of a map together.

    Attributes:
        maps: largest number of maps of a partner.
        known: whether each partner has several maps. With one every replicate is the same, which is no uncertainty of
            zero.
        means: by robot and partner; NaN without a value.
        replicates: the same, `(REPLICATES,)` each.
    """

    maps: int
    known: bool
    means: Mapping[str, Mapping[str, float]]
    replicates: Mapping[str, Mapping[str, Array]]

    @classmethod
    def of(cls, values: Values, maps: Mapping[str, Sequence[str]], seed: int = 0) -> "MapBootstrap":
        """Draws the same maps for all robots, and for all partners with the same maps.

        Args:
            maps: of each partner.
        """
        rng = np.random.default_rng(seed)
        weights: dict[tuple[str, ...], Array] = {}
        means: dict[str, dict[str, float]] = {robot: {} for robot in values}
        replicates: dict[str, dict[str, Array]] = {robot: {} for robot in values}
        for partner, names in maps.items():
            drawn = tuple(names)
            if drawn not in weights:
                uniform = np.full(len(drawn), 1 / len(drawn))
                weights[drawn] = rng.multinomial(len(drawn), uniform, size=REPLICATES).astype(float)
            index = {name: position for position, name in enumerate(drawn)}
            for robot, by_partner in values.items():
                positions = [index[name] for name, _ in by_partner[partner]]
                sums = np.bincount(positions, [value for _, value in by_partner[partner]], minlength=len(drawn))
                episodes = np.bincount(positions, minlength=len(drawn))
                with np.errstate(invalid="ignore"):
                    means[robot][partner] = float(np.divide(sums.sum(), episodes.sum()))
                    replicates[robot][partner] = (weights[drawn] @ sums) / (weights[drawn] @ episodes)
        return cls(max(map(len, weights)), min(map(len, weights)) > 1, means, replicates)

    def mean(self, robot: str) -> float:
        """Mean over the partners with which the robot has a value; NaN without any."""
        known = [mean for mean in self.means[robot].values() if not np.isnan(mean)]
        return float(np.mean(known)) if known else np.nan

    def totals(self, robot: str) -> Array:
        """`(REPLICATES,)` replicates of `mean`."""
        values = np.array(list(self.replicates[robot].values()))
        known = ~np.isnan(values)
        with np.errstate(invalid="ignore"):
            return np.where(known, values, 0.0).sum(axis=0) / known.sum(axis=0)

    def estimate(self, robot: str, partner: str | None = None) -> dict[str, Any]:
        """Mean, standard error and 95 % interval of a robot, with all partners or one."""
        if partner is None:
            return self._estimate(self.mean(robot), self.totals(robot))
        return self._estimate(self.means[robot][partner], self.replicates[robot][partner])

    def difference(self, robot: str, other: str) -> dict[str, Any]:
        """Mean of a robot minus that of another, with its size in standard errors."""
        mean = self.mean(robot) - self.mean(other)
        found = self._estimate(mean, self.totals(robot) - self.totals(other))
        error = found["standard_error"]
        return {**found, "standard_errors": mean / error if error else None}

    def differences(self, robots: Sequence[str], others: Sequence[str]) -> dict[str, dict[str, Any]]:
        """`difference` of each robot that is none of `others` to each of them."""
        return {
            robot: {other: self.difference(robot, other) for other in others} for robot in robots if robot not in others
        }

    def _estimate(self, mean: float, replicates: Array) -> dict[str, Any]:
        finite = replicates[~np.isnan(replicates)]
        if not self.known or not len(finite):
            return {"mean": mean, "standard_error": None, "bootstrap_95": None}
        low, high = np.quantile(finite, (0.025, 0.975))
        return {"mean": mean, "standard_error": float(finite.std()), "bootstrap_95": [float(low), float(high)]}
