"""The whole analysis of a within-subject design: description, ANOVA, its assumptions, rank tests and contrasts."""

import math
from typing import Any

import numpy as np

from ..markdown_table import markdown_table
from .anova import NORMALITY_LEVEL, analysis_of_variance, rank_test, residual_normality
from .contrasts import REPLICATES, contrasts, tukey
from .measurements import Measurements

DEFINITIONS = {
    "standard_error": "standard deviation between units / square root of n",
    "p_greenhouse_geisser": "p with degrees of freedom times epsilon; allows for differences of unequal variance",
    "sphericity": "Mauchly's test; a small sample rarely rejects, so the corrected p is the one to report",
    "partial_eta_squared": "effect / (effect + its error), sums of squares",
    "generalized_eta_squared": "Olejnik and Algina (2003); comparable between designs",
    "recommended": f"rank tests if Shapiro and Wilk's test rejects normality (p < {NORMALITY_LEVEL:g}), else ANOVA",
    "contrasts": "paired t and Wilcoxon tests; p_holm is Holm's correction over all contrasts of one question",
    "bootstrap_95": f"bias-corrected and accelerated bootstrap of the difference over units, {REPLICATES} replicates; "
    "too narrow in small studies",
    "tukey": "honestly significant differences on the error term of the one-way ANOVA",
    "hedges_g": "difference / pooled standard deviation of both conditions, with Hedges' correction",
}


def analyse(measurements: Measurements) -> dict[str, Any]:
    """Analyses a design with one or two within-subject factors; the returned dict can be written as JSON."""
    if not measurements.units:
        nothing: dict[str, Any] = {"units": [], "anova": None, "rank_tests": {}, "contrasts": {}, "cells": []}
        measured = {"measure": measurements.measure, "unit_of_analysis": measurements.description}
        return {**measured, **nothing, "recommended": "none", "definitions": DEFINITIONS}
    effects = analysis_of_variance(measurements)
    normality = residual_normality(measurements)
    skewed = normality is not None and normality["p"] < NORMALITY_LEVEL
    one_way = len(measurements.factors) == 1
    factors = measurements.factors.items()
    return {
        "measure": measurements.measure,
        "unit_of_analysis": measurements.description,
        "units": list(measurements.units),
        "factors": {name: list(levels) for name, levels in factors},
        "cells": _cells(measurements),
        "anova": effects,
        "normality": None if normality is None else {"test": "Shapiro-Wilk", "of": "residuals", **normality},
        "rank_tests": {name: rank_test(measurements.over(name)) for name, _ in factors},
        "recommended": "rank tests" if skewed or effects is None else "anova",
        "contrasts": contrasts(measurements),
        **({"tukey": tukey(measurements.values, next(iter(measurements.factors.values())))} if one_way else {}),
        "definitions": DEFINITIONS if one_way else {k: v for k, v in DEFINITIONS.items() if k != "tukey"},
    }


def _cells(measurements: Measurements) -> list[dict[str, Any]]:
    values, n = measurements.values, len(measurements.units)
    cells = []
    for index in np.ndindex(values.shape[1:]):
        column = values[(slice(None), *index)]
        levels = {name: found[k] for (name, found), k in zip(measurements.factors.items(), index, strict=True)}
        deviation = float(column.std(ddof=1)) if n > 1 else None
        error = None if deviation is None else deviation / math.sqrt(n)
        cells.append({**levels, "mean": float(column.mean()), "sd": deviation, "standard_error": error, "n": n})
    return cells


def markdown(analysis: dict[str, Any]) -> str:
    """Tables of the conditions, the effects and the contrasts, with the unit of analysis on top."""
    factors = list(analysis["factors"])
    blocks = [
        f"**{analysis['measure']}** by {' and '.join(factors)}; {analysis['unit_of_analysis']}.",
        markdown_table(
            [*factors, "mean", "SD", "SE"],
            [[*(cell[name] for name in factors), *map(_number, (cell["mean"], cell["sd"], cell["standard_error"]))]
             for cell in analysis["cells"]],
        ),
    ]  # fmt: skip
    if analysis["anova"] is None:
        blocks.append("No ANOVA: it needs at least two units and levels, and some spread within units.")
    else:
        head = ["effect", "F", "p", "Greenhouse-Geisser p (epsilon)", "Mauchly W (p)", "partial eta²"]
        blocks.append(markdown_table(head, [_effect_row(effect) for effect in analysis["anova"]]))
    for name, test in analysis["rank_tests"].items():
        if test is not None:
            blocks.append(f"{test['test']}, {name}: statistic {test['statistic']:.3f}, p = {_p(test['p'])}.")
    normality = analysis["normality"]
    if normality is not None:
        text = f"Shapiro-Wilk of the residuals: W = {normality['W']:.3f}, p = {_p(normality['p'])}"
        blocks.append(f"{text}; recommended: {analysis['recommended']}.")
    name = "wilcoxon" if analysis["recommended"] == "rank tests" else "paired_t"
    for question, pairs in analysis["contrasts"].items():
        head = [
            question,
            "difference",
            "bootstrap 95 %",
            "Wilcoxon p" if name == "wilcoxon" else "t",
            "p (Holm)",
            "Hedges' g",
        ]
        blocks.append(markdown_table(head, [_contrast_row(pair, name) for pair in pairs]))
    return "\n\n".join(blocks) + "\n"


def _effect_row(effect: dict[str, Any]) -> list[str]:
    sphericity = effect["sphericity"]
    return [
        effect["source"],
        f"F({effect['df'][0]}, {effect['df'][1]}) = {effect['F']:.3f}",
        _p(effect["p"]),
        f"{_p(effect['p_greenhouse_geisser'])} ({effect['epsilon']:.2f})",
        "" if sphericity is None else f"{sphericity['W']:.3f} ({_p(sphericity['p'])})",
        f"{effect['partial_eta_squared']:.3f}",
    ]


def _contrast_row(pair: dict[str, Any], name: str) -> list[str]:
    at, test = (f"{pair['at']}: " if "at" in pair else ""), pair[name]
    label = f"{at}{pair['first']} - {pair['second']}"
    if test is None:
        return [label, f"{pair['difference']:+.3f}", "", "no spread", "", ""]
    statistic = f"t({test['df']}) = {test['t']:.3f}, p = {_p(test['p'])}" if name == "paired_t" else _p(test["p"])
    low, high = pair["bootstrap_95"]
    interval = f"{low:+.3f} to {high:+.3f}"
    return [label, f"{pair['difference']:+.3f}", interval, statistic, _p(test["p_holm"]), _number(pair["hedges_g"])]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _p(value: float) -> str:
    return "< .0001" if value < 1e-4 else f"{value:.4f}".lstrip("0")
