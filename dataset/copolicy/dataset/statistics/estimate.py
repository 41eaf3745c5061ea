"""A statistic with all that belongs to it: what it is, its unit, how sure it is, and what chance alone would give."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

_DIGITS = 6  # more would differ between machines


@dataclass(frozen=True)
class Null:
    """What the statistic would be by chance.

    Attributes:
        how: how chance was made.
        low, high: 2.5 and 97.5 percent quantiles.
        p: share of chance results at least as extreme, the observed one counted among them.
    """

    how: str
    mean: float
    low: float
    high: float
    p: float

    @classmethod
    def from_draws(cls, how: str, value: float, draws: np.ndarray, two_sided: bool = False) -> "Null":
        """From the statistic under chance `(n,)`; one-sided means larger than chance."""
        centre = float(np.mean(draws))
        distance = np.abs(draws - centre) if two_sided else draws
        observed = abs(value - centre) if two_sided else value
        # Equal up to rounding is equal: a statistic that cannot vary has p = 1.
        p = (1 + np.sum(distance >= observed - 1e-9)) / (1 + len(draws))
        low, high = np.quantile(draws, (0.025, 0.975))
        return cls(how, centre, float(low), float(high), float(p))


@dataclass(frozen=True)
class Estimate:
    """One statistic.

    Attributes:
        value: None where it cannot be computed; `note` says why.
        interval: 95 percent confidence interval; `resampled` says what was drawn anew for it.
        episodes: how many episodes it rests on.
        details: the parts it is made of, JSON-able.
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
        """For JSON: numbers of six digits, None for what is not finite, nothing that is empty."""
        entry: dict[str, Any] = {"value": self.value, "unit": self.unit, "interval": self.interval}
        if self.interval is not None:
            entry["resampled"] = self.resampled
        if self.null is not None:
            entry["null"] = vars(self.null)
        entry |= {"episodes": self.episodes, "definition": self.definition}
        entry |= {name: value for name, value in (("note", self.note), ("details", self.details)) if value}
        return rounded(entry)


def left_out(reason: str, *names: str) -> dict[str, Estimate]:
    """Statistics that a task lacks the part for.

    Args:
        reason: of `PairTask.missing`.
    """
    return {name: Estimate(None, "1", "Not defined for this task.", 0, note=reason) for name in names}


def rounded(value: Any) -> Any:
    """The same with plain numbers of six digits, None for what is not finite, lists for tuples and arrays."""
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
