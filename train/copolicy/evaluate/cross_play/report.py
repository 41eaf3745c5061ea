"""The matrix of a cross-play as Markdown and CSV."""

import csv
import io
from collections.abc import Mapping
from typing import Any

from ..markdown_table import estimate_text, markdown_table
from .cells import OWN_KIND
from .measures import MEASURES, label, over_partners
from .score import FACTOR

SCORE_LABEL = f"score: success within {FACTOR:g} x own kind's time and force, %"

_DIFFERENCES = ("score, points", "/ standard error", "gave way, points", "/ standard error")
_DIFFERENCES_TITLE = "Differences, bootstrap over maps (gave way: over the partners with which both had adaptations):"
_COLUMNS = ("mean", "standard_error", "n")


def markdown(result: Mapping[str, Any]) -> str:
    """Scores of methods and robots, separation from floors, a table of robots and partners for each measure, notes."""
    settings, scores = result["settings"], result["scores"]
    yielding = result["gave_way"].get("separation", {})
    text = [
        f"**Cross-play, {settings['maps']} maps**: {settings['episodes_per_cell']} episodes per cell on "
        f"{settings['configurations']} starts, {settings['actions_per_plan']} action(s) per chunk, at most "
        f"{settings['step_limit']} steps. {result['label']}.",
        *_methods(result),
        _scores(result),
        *_factors(result),
    ]
    if separation := scores.get("separation"):
        rows = [
            [robot, floor, *_difference(difference), *_difference(yielding.get(robot, {}).get(floor))]
            for robot, floors in separation.items()
            for floor, difference in floors.items()
        ]
        text.append(f"{_DIFFERENCES_TITLE}\n\n" + markdown_table(["robot", "minus floor", *_DIFFERENCES], rows))
    partners = list(result["partners"])
    if scores:
        rows = [
            [robot, *(estimate_text(score["by_partner"].get(partner), 100, 1) for partner in partners)]
            for robot, score in scores["robots"].items()
        ]
        text.append(f"**{SCORE_LABEL}**\n\n" + markdown_table(["robot", *partners], rows))
    for name in MEASURES:
        if name in result["not_measured"]:
            continue
        rows = [
            [robot, *(_cell(row.get(partner), name) for partner in partners)] for robot, row in result["cells"].items()
        ]
        text.append(f"**{label(name, settings['length_unit'])}**\n\n" + markdown_table(["robot", *partners], rows))
    notes = {**result["definitions"], **result["not_measured"], **result["no_own_kind"]}
    text.append("\n".join(f"- {name}: {note}." for name, note in notes.items()))
    return "\n\n".join(text) + "\n"


def _scores(result: Mapping[str, Any]) -> str:
    """Robots in the order of their scores, with means over partners of the other measures."""
    scores = result["scores"].get("robots", {})
    shown = [name for name in MEASURES if name not in result["not_measured"]]
    rows = []
    for robot in sorted(result["cells"], key=lambda name: -scores.get(name, {"mean": 0.0})["mean"]):
        score, row = scores.get(robot), result["cells"][robot]
        first = "" if score is None or "first" not in score else f"{100 * score['first']:.0f} %"
        timely = "none" if score is None else f"{100 * score['in_time']:.1f}"
        rows.append(
            [robot, estimate_text(score, 100, 1), first, timely, *(_over_partners(row, name) for name in shown)]
        )
    head = [
        "robot",
        "partner score, %",
        "first in",
        "success in time, %",
        *(label(name, result["settings"]["length_unit"]) for name in shown),
    ]
    return "Scores and their parts, means over partners:\n\n" + markdown_table(head, rows)


def _methods(result: Mapping[str, Any]) -> list[str]:
    """Methods in the order of their scores with standard errors over training seeds, and differences of scores."""
    methods = result.get("methods", {})
    if not methods:
        return []
    shown = [name for name in MEASURES if name not in result["not_measured"]]
    units = [label(name, result["settings"]["length_unit"]) for name in shown]
    rows = [
        [
            name,
            str(len(method["robots"])),
            estimate_text(method["score"], 100, 1),
            estimate_text(method["in_time"], 100, 1),
            *(estimate_text(method["measures"][each], MEASURES[each].scale, MEASURES[each].digits) for each in shown),
        ]
        for name, method in sorted(methods.items(), key=lambda item: -(item[1]["score"] or {"mean": 0.0})["mean"])
    ]
    head = ["method", "seeds", "partner score, %", "success in time, %", *units]
    differences = [
        [name, other, *_difference(difference), *_difference(method["gave_way_differences"].get(other))]
        for name, method in methods.items()
        for other, difference in method["differences"].items()
    ]
    text = ["Methods, mean ± standard error over training seeds:\n\n" + markdown_table(head, rows)]
    if differences:
        head = ["method", "minus", *_DIFFERENCES]
        text.append(f"{_DIFFERENCES_TITLE}\n\n" + markdown_table(head, differences))
    return text


def _factors(result: Mapping[str, Any]) -> list[str]:
    """Of each factor of the starts, scores of methods and robots by its values."""
    text = []
    for name, by_value in result["by_factor"].items():
        values = list(by_value.values())
        methods = {method: [each["methods"][method]["score"] for each in values] for method in result["methods"]}
        robots = {robot: [each["robots"][robot] for each in values] for robot in values[0]["robots"]}
        rows = [
            [row, *(estimate_text(score, 100, 1) for score in scores)]
            for scored in (methods, robots)
            for row, scores in scored.items()
        ]
        head = ["method or robot" if methods else "robot", *by_value]
        text.append(
            f"Partner score by {name}, % ({_factor_notes(result, values[0])}):\n\n" + markdown_table(head, rows)
        )
    return text


def _factor_notes(result: Mapping[str, Any], of_value: Mapping[str, Any]) -> str:
    """What the errors are, and over which partners the scores are if not over all."""
    notes = ["robots: bootstrap over maps"]
    if result["methods"]:
        notes.append("methods: standard error over training seeds")
    scored, every = (next(iter(each["robots"].values()))["by_partner"] for each in (of_value, result["scores"]))
    if len(scored) < len(every):
        notes.append(f"only with {', '.join(scored)}")
    return "; ".join(notes)


def _over_partners(row: Mapping[str, Any], name: str) -> str:
    measure, mean = MEASURES[name], over_partners(row, name)
    return "none" if mean is None else f"{measure.scale * mean:.{measure.digits}f}"


def _cell(cell: Mapping[str, Any] | None, name: str) -> str:
    measure = MEASURES[name]
    return "none" if cell is None else estimate_text(cell["measures"][name], measure.scale, measure.digits)


def _difference(difference: Mapping[str, Any] | None) -> tuple[str, str]:
    """A difference in points, and in standard errors; None if one of both has no value."""
    if difference is None:
        return "none", "none"
    ratio = difference["standard_errors"]
    return estimate_text(difference, 100, 1), "unknown" if ratio is None else f"{ratio:.1f}"


def csv_text(result: Mapping[str, Any]) -> str:
    """One row per cell: mean, standard error and number of episodes of each measure, the score, the wall time."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    scores = result["scores"].get("robots", {})
    names = [f"{name}_{column}" for name in MEASURES for column in _COLUMNS]
    writer.writerow(["robot", "partner", "is_own_kind", "score_mean", "score_standard_error", *names, "wall_s"])
    for robot, row in result["cells"].items():
        for partner, cell in row.items():
            score = scores.get(robot, {}).get("by_partner", {}).get(partner) or {}
            values = [(cell["measures"][name] or {}).get(column, "") for name in MEASURES for column in _COLUMNS]
            parts = [score.get("mean", ""), score.get("standard_error", ""), *values, cell["wall_s"]]
            own = str(robot == OWN_KIND).lower()
            writer.writerow([robot, partner, own, *("" if part is None else part for part in parts)])
    return buffer.getvalue()
