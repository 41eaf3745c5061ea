"""Repeated-measures analysis of variance with one or two factors, by pingouin."""

import math
import warnings
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
    if len(values) < 2 or min(values.shape[1:]) < 2 or _has_no_error(values):
        return None
    import pingouin  # takes seconds to import

    factors = list(measurements.factors)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of sphericity tests without spread; their results are then None
        table = pingouin.rm_anova(
            data=_long(measurements),
            dv="value",
            within=factors if len(factors) > 1 else factors[0],
            subject="unit",
            correction=True,  # pyright: ignore[reportArgumentType] (annotated as a text, documented as a bool)
            detailed=True,
            effsize="ng2",
        )
    rows: list[dict[str, Any]] = table.to_dict("records")  # pyright: ignore[reportAssignmentType] (keys are names)
    degrees = [(int(row["ddof1"]), int(row["ddof2"])) for row in rows] if "ddof1" in rows[0] else [
        (int(rows[0]["DF"]), int(rows[1]["DF"]))
    ]  # fmt: skip
    return [_effect(row, *df) for row, df in zip(rows, degrees, strict=False)]


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


def _effect(row: dict[str, Any], first: int, second: int) -> dict[str, Any]:
    f, epsilon = float(row["F"]), float(row["eps"])
    sphericity = None
    if first > 1 and math.isfinite(row["W_spher"]) and math.isfinite(row["p_spher"]):
        sphericity = {"test": "Mauchly", "W": float(row["W_spher"]), "p": float(row["p_spher"])}
    return {
        "source": str(row["Source"]).replace(" * ", " x "),
        "F": f,
        "df": [first, second],
        "p": float(row["p_unc"]),
        "epsilon": epsilon,
        "p_greenhouse_geisser": float(stats.f.sf(f, epsilon * first, epsilon * second)),
        "sphericity": sphericity,
        "partial_eta_squared": f * first / (f * first + second),
        "generalized_eta_squared": float(row["ng2"]),
    }


def _long(measurements: Measurements) -> Any:
    import pandas

    records = []
    for index in np.ndindex(measurements.values.shape):
        levels = {name: found[k] for (name, found), k in zip(measurements.factors.items(), index[1:], strict=True)}
        records.append({"unit": measurements.units[index[0]], **levels, "value": float(measurements.values[index])})
    return pandas.DataFrame(records)


def _residuals(values: Array) -> Array:
    return values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean()


def _has_no_error(values: Array) -> bool:
    """Whether an error term is zero, which leaves its F undefined."""
    tables = [values] if values.ndim == 2 else [values.mean(axis=2), values.mean(axis=1)]
    spread = float(((values - values.mean()) ** 2).sum())
    if spread <= 1e-24 * float((values**2).sum()):
        return True  # equal but for rounding
    if any(float((_residuals(table) ** 2).sum()) <= 1e-12 * max(spread, 1e-300) for table in tables):
        return True
    if values.ndim == 2:
        return False
    a, b = values.mean(axis=2, keepdims=True), values.mean(axis=1, keepdims=True)
    unit, cell = values.mean(axis=(1, 2), keepdims=True), values.mean(axis=0, keepdims=True)
    fitted = a + b + cell - unit - a.mean(axis=0, keepdims=True) - b.mean(axis=0, keepdims=True) + values.mean()
    return float(((values - fitted) ** 2).sum()) <= 1e-12 * max(spread, 1e-300)
