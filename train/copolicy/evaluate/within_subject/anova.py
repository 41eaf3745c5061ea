"""Repeated-measures analysis of variance with one or two factors, from orthonormal contrasts of the conditions."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from copolicy.dataset.arrays import Array

from .measurements import Measurements

NORMALITY_LEVEL = 0.05
"""Below this p of Shapiro and Wilk's test of the residuals, rank tests are recommended."""


def analysis_of_variance(measurements: Measurements) -> list[dict[str, Any]] | None:
    """The effects of the factors and, with two, of their interaction.

    Returns:
        For each effect: F, degrees of freedom, p, Greenhouse and Geisser's epsilon and p, Mauchly's test of sphericity
        (None for two levels), partial and generalized eta squared. None with fewer than two units or levels, or without
        spread within units beyond the effects.
    """
    values = measurements.values
    n, levels = len(values), values.shape[1:]
    if n < 2 or min(levels) < 2 or _has_no_error(values):
        return None
    conditions = values.reshape(n, -1)
    scores = {name: _Scores(conditions @ contrasts) for name, contrasts in _contrasts(measurements.factors).items()}
    between = conditions.shape[1] * float(((conditions.mean(axis=1) - conditions.mean()) ** 2).sum())
    # Of Olejnik and Algina (2003): all sums of squares that come from differences between units.
    measured = between + sum(score.error for score in scores.values())
    return [_effect(name, score, measured, math.prod(levels)) for name, score in scores.items()]


def residual_normality(measurements: Measurements) -> dict[str, float] | None:
    """Shapiro and Wilk's test of the residuals of the additive model; None if they are fewer than three or constant."""
    values = measurements.values.reshape(len(measurements.values), -1)
    residuals = _residuals(values).ravel()
    if len(residuals) < 3 or np.ptp(residuals) < 1e-12:
        return None
    result = stats.shapiro(residuals)
    return {"W": float(result.statistic), "p": float(result.pvalue)}


def rank_test(values: Array) -> dict[str, Any] | None:
    """Friedman's test of values `(n, k)` with Kendall's W, or Wilcoxon's for two conditions.

    None for fewer than two units or conditions, or if no unit has a difference.
    """
    n, k = values.shape
    if n < 2 or k < 2 or not np.ptp(values, axis=1).any():
        return None
    if k == 2:
        result = stats.wilcoxon(values[:, 0], values[:, 1], zero_method="zsplit")
        return {"test": "Wilcoxon signed rank", "statistic": float(result.statistic), "p": float(result.pvalue)}  # pyright: ignore
    result = stats.friedmanchisquare(*values.T)
    statistic = float(result.statistic)
    return {
        "test": "Friedman",
        "statistic": statistic,
        "df": k - 1,
        "p": float(result.pvalue),
        "kendalls_w": statistic / (n * (k - 1)),
    }


@dataclass(frozen=True)
class _Scores:
    """Scores `(n, d)` of the units on the d orthonormal contrasts of an effect."""

    values: Array

    @property
    def effect(self) -> float:
        """Sum of squares of the effect."""
        return len(self.values) * float((self.values.mean(axis=0) ** 2).sum())

    @property
    def error(self) -> float:
        """Sum of squares of its error term, the interaction of effect and units."""
        return float(((self.values - self.values.mean(axis=0)) ** 2).sum())

    @property
    def covariance(self) -> Array:
        """Between units, `(d, d)`."""
        return np.atleast_2d(np.cov(self.values, rowvar=False))


def _contrasts(factors: Any) -> dict[str, Array]:
    """Orthonormal contrasts `(conditions, d)` of each effect, the second factor's levels running fastest."""
    sizes = [len(levels) for levels in factors.values()]
    if len(sizes) == 1:
        return {next(iter(factors)): _deviations(sizes[0])}
    (first, second), (a, b) = factors, sizes
    return {
        first: np.kron(_deviations(a), _mean(b)),
        second: np.kron(_mean(a), _deviations(b)),
        f"{first} x {second}": np.kron(_deviations(a), _deviations(b)),
    }


def _deviations(levels: int) -> Array:
    """An orthonormal basis `(levels, levels - 1)` of the deviations from the mean of the levels (Helmert's)."""
    basis = np.tril(np.ones((levels, levels - 1)), -1)
    basis[np.diag_indices(levels - 1)] = -np.arange(levels - 1, 0, -1)
    return basis / np.linalg.norm(basis, axis=0)


def _mean(levels: int) -> Array:
    return np.full((levels, 1), 1 / math.sqrt(levels))


def _effect(name: str, scores: _Scores, measured: float, conditions: int) -> dict[str, Any]:
    n, d = scores.values.shape
    first, second = d, d * (n - 1)
    f = scores.effect / first / (scores.error / second)
    covariance = scores.covariance
    epsilon = min(1.0, float(np.trace(covariance) ** 2 / (d * (covariance @ covariance).trace()))) if d > 1 else 1.0
    return {
        "source": name,
        "F": f,
        "df": [first, second],
        "p": float(stats.f.sf(f, first, second)),
        "epsilon": epsilon,
        "p_greenhouse_geisser": float(stats.f.sf(f, epsilon * first, epsilon * second)),
        "sphericity": _sphericity(covariance, n - 1, conditions) if d > 1 else None,
        "partial_eta_squared": f * first / (f * first + second),
        "generalized_eta_squared": scores.effect / (scores.effect + measured),
    }


def _sphericity(covariance: Array, degrees: int, conditions: int) -> dict[str, Any] | None:
    """Mauchly's test (1940) with Box's approximation of second order, as `mauchly.test` of R computes it.

    Args:
        covariance: `(d, d)` of the contrasts' scores.
        degrees: of freedom of the covariance.
        conditions: number of all conditions, which R takes for the levels in the term of second order.
    """
    d = len(covariance)
    sign, logarithm = np.linalg.slogdet(covariance)
    if sign <= 0:
        return None
    log_w = logarithm - d * math.log(np.trace(covariance) / d)
    factor = 1 - (2 * d**2 + d + 2) / (6 * d * degrees)
    if factor == 0:
        return None
    second = (d + 2) * (d - 1) * (d - 2) * (2 * d**3 + 6 * d**2 + 3 * conditions + 2)
    second /= 288 * (degrees * d * factor) ** 2
    chi_squared, free = -degrees * factor * log_w, d * (d + 1) / 2 - 1
    p = stats.chi2.sf(chi_squared, free)
    p += second * (stats.chi2.sf(chi_squared, free + 4) - p)
    return {"test": "Mauchly", "W": math.exp(log_w), "p": float(p)}


def _residuals(values: Array) -> Array:
    return values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean()


def _has_no_error(values: Array) -> bool:
    """Whether an error term is zero, which leaves its F undefined."""
    tables = [values] if values.ndim == 2 else [values.mean(axis=2), values.mean(axis=1)]
    spread = float(((values - values.mean()) ** 2).sum())
    if any(float((_residuals(table) ** 2).sum()) <= 1e-12 * max(spread, 1e-300) for table in tables):
        return True
    if values.ndim == 2:
        return False
    a, b = values.mean(axis=2, keepdims=True), values.mean(axis=1, keepdims=True)
    unit, cell = values.mean(axis=(1, 2), keepdims=True), values.mean(axis=0, keepdims=True)
    fitted = a + b + cell - unit - a.mean(axis=0, keepdims=True) - b.mean(axis=0, keepdims=True) + values.mean()
    return float(((values - fitted) ** 2).sum()) <= 1e-12 * max(spread, 1e-300)
