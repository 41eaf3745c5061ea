"""Formats a comparison as Markdown tables."""

from collections.abc import Mapping
from typing import Any

from ..markdown_table import markdown_table


def markdown(comparison: Mapping[str, Any]) -> str:
    """Returns a table of the methods, a table of the differences, and the definitions of the measures."""
    methods, settings = comparison["methods"], comparison["settings"]
    parts = list(next(iter(methods.values()))["parts"])
    missing = comparison.get("not_measured", {})
    measures = {"time_s": ("time, s", 2), "interaction_mean": ("interaction force", 4)}
    measures = {name: measure for name, measure in measures.items() if name not in missing}
    labels = [label for label, _ in measures.values()]
    rows = [
        [
            name,
            str(method["success"]["runs"]),
            f"{_percent(method['success'])} ({100 * method['success']['max']:.1f})",
            *(_mean(method[measure], digits) for measure, (_, digits) in measures.items()),
            *(_percent(method["parts"][part]["success"]) for part in parts),
        ]
        for name, method in methods.items()
    ]
    text = [
        f"**{comparison['study']}, {settings.get('maps', '?')} maps**, {comparison['episodes_per_run']} episodes per "
        f"run, {settings.get('actions_per_plan', '?')} actions per chunk, each held for {settings.get('hold', '?')} "
        f"steps, at most {settings.get('step_limit', '?')} steps ({comparison['label']}).",
        markdown_table(["method", "runs", "success, % (max)", *labels, *(f"{part}, %" for part in parts)], rows),
    ]
    if comparison["differences"]:
        rows = [
            [
                f"{difference['first']} - {difference['second']}",
                _interval(difference["success"], 100, 1),
                *(_interval(difference[measure], 1, digits) for measure, (_, digits) in measures.items()),
                *_tests(difference),
            ]
            for difference in comparison["differences"]
        ]
        text.append(
            markdown_table(["difference", "success, points", *labels, "McNemar p", "between runs, points"], rows)
        )
    notes = {name: comparison["definitions"][name] for name in ("success", "bootstrap_95", "between_runs")}
    text.append("\n".join(f"- {name}: {note}." for name, note in {**notes, **missing}.items()))
    return "\n\n".join(text) + "\n"


def _tests(difference: Mapping[str, Any]) -> list[str]:
    between, mcnemar = difference["between_runs"], difference["mcnemar"]
    return [
        f"{mcnemar['p']:.3g} ({mcnemar['only_first']} against {mcnemar['only_second']})" if mcnemar else "",
        "{:+.1f} to {:+.1f}, p {:.3g}".format(*(100 * bound for bound in between["interval_95"]), between["p"])
        if between
        else "",
    ]


def _percent(success: Mapping[str, Any]) -> str:
    return f"{100 * success['mean']:.1f} ± {100 * success['standard_error']:.1f}"


def _mean(value: Mapping[str, Any], digits: int) -> str:
    if value["mean"] is None:
        return "none"
    error = value["standard_error"]
    return f"{value['mean']:.{digits}f}" + ("" if error is None else f" ± {error:.{digits}f}")


def _interval(difference: Mapping[str, Any], scale: float, digits: int) -> str:
    if difference["mean"] is None:
        return "none"
    mean = f"{scale * difference['mean']:+.{digits}f}"
    if difference["bootstrap_95"] is None:
        return mean
    low, high = (f"{scale * bound:+.{digits}f}" for bound in difference["bootstrap_95"])
    return f"{mean} ({low} to {high})"
