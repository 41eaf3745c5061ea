"""The value of a statistic with definition, unit, confidence interval and null distribution."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..arrays import Array

_DIGITS = 6  # more would differ between machines


@dataclass(frozen=True)
class Null:
    """The null distribution of a statistic.

    Attributes:
        how: how the null distribution was drawn.
        low, high: 2.5 and 97.5 percent quantiles.
        p: proportion of draws at least as extreme as the observed value, which counts as one of them.
    """

    how: str
    mean: float
    low: float
    high: float
    p: float

    @classmethod
    def from_draws(cls, method: str, value: float, draws: Array, two_sided: bool = False) -> "Null":
        """From draws `(n,)` of the statistic under the null hypothesis; a one-sided test is for larger values."""
        centre = float(np.mean(draws))
        distance = np.abs(draws - centre) if two_sided else draws
        observed = abs(value - centre) if two_sided else value
        # Tolerates rounding, so that a constant statistic has p = 1.
        p = (1 + np.sum(distance >= observed - 1e-9)) / (1 + len(draws))
        low, high = np.quantile(draws, (0.025, 0.975))
        return cls(method, centre, float(low), float(high), float(p))


@dataclass(frozen=True)
class Estimate:
    """One statistic.

    Attributes:
        value: None if it cannot be computed; `note` states the reason.
        interval: 95 percent confidence interval.
        resampled: what the bootstrap for the interval resampled.
        episodes: number of episodes that the value is based on.
        details: components of the value, JSON-compatible.
    """

    value: float | None
    unit: str
    definition: str
    episodes: int
    interval: tuple[float, float] | None = None
    resampled: str = ""
    null: Null | None = None
    note: str = ""
    details: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """A JSON-compatible dictionary: numbers with six digits, None for NaN and infinity, no empty entries."""
        entry: dict[str, Any] = {"value": self.value, "unit": self.unit, "interval": self.interval}
        if self.interval is not None:
            entry["resampled"] = self.resampled
        if self.null is not None:
            entry["null"] = vars(self.null)
        entry |= {"episodes": self.episodes, "definition": self.definition}
        entry |= {name: value for name, value in (("note", self.note), ("details", self.details)) if value}
        return rounded(entry)


def left_out(reason: str, *names: str) -> dict[str, Estimate]:
    """Estimates without value for statistics that need a part that the task lacks (`reason`: `PairTask.missing`)."""
    return {name: Estimate(None, "1", "Not defined for this task.", 0, note=reason) for name in names}


def rounded(value: Any) -> Any:
    """JSON-compatible copy: numbers rounded to six digits, None for NaN and infinity, lists for tuples and arrays."""
    if isinstance(value, dict):
        return {str(key): rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [rounded(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    return value
