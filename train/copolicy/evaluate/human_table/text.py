"""The tables as Markdown and as CSV."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from ..human_study.summary import mean_text
from ..markdown_table import markdown_table
from .tables import MEASURES

_P_SMALLEST = 1e-4
_NAMES = {"time_s": "simulated time", "interaction_mean": "interaction force"}


def markdown(table: Mapping[str, Any]) -> str:
    """The tables with the label and the unit of analysis on top, tests below each, published numbers beside them."""
    settings, missing = table["settings"], table.get("not_measured", {})
    people = len(table["participants"])
    text = [
        "# Robots beside people",
        f"**{_sentence(table['label'])}**",
        f"Unit of analysis: {table['unit_of_analysis']}. Participants: {people}; episodes: "
        f"{sum(row['episodes'] for row in table['robots'])} of {table['planned']} planned, on {settings['starts']} "
        f"starts; at most {settings['step_limit']} steps. Plan {settings['plan_id']}.",
        "## Success, times, force, planning",
        _robots(table["robots"], missing),
        _tests(table["tests"]["robots"]),
    ]
    if table["fronts"]:
        text += ["## Success by set-up", _fronts(table["fronts"], missing), _tests(table["tests"]["fronts"])]
    if table["questionnaires"]:
        drawn = "The answers of the simulated sessions were drawn at random." if table["source"] != "human" else ""
        text += ["## Questionnaires", drawn, _questionnaires(table["questionnaires"])]
        sources = dict.fromkeys(row["source"] for row in table["questionnaires"] if row["source"])
        text += ["\n".join(f"- {source}" for source in sources)] if sources else []
    if table["published_source"]:
        text += ["## Published numbers", f"{table['published_source']}."]
    notes = {**table["definitions"], **missing}
    text += ["## Definitions", "\n".join(f"- {name}: {note}." for name, note in notes.items())]
    left_out = {**table["left_out"], **{f"{name}: no episode": "" for name in table["robots_without_episodes"]}}
    if left_out:
        text += ["## Left out", "\n".join(f"- {name} {count}".rstrip() for name, count in left_out.items())]
    return "\n\n".join(part for part in text if part) + "\n"


def _robots(rows: Sequence[Mapping[str, Any]], missing: Mapping[str, str]) -> str:
    heads = [
        "robot", "people", "episodes", "success ± SE (SD), %", "simulated time ± SE, s", "wall time ± SE, s",
        "interaction force ± SE", "planning ± SE, ms",
    ]  # fmt: skip
    published = any(row["published"] for row in rows)
    heads += ["published: success, %", "published: wall time, s", "published: planning, ms"] if published else []
    lines = []
    for row in rows:
        lines.append(
            [
                row["robot"],
                str(row["success"]["participants"]),
                str(row["episodes"]),
                _with_deviation(row["success"]),
                mean_text(row["time_s"], 1, 1),
                mean_text(row["wall_time_s"], 1, 1),
                mean_text(row["interaction_mean"], 1, 3),
                mean_text(row["planning_ms"], 1, 2),
                *(_published_results(row) if published else []),
            ]
        )
    return _without(heads, lines, "interaction force ± SE" if "interaction_force" in missing else "")


def _fronts(rows: Sequence[Mapping[str, Any]], missing: Mapping[str, str]) -> str:
    heads = [
        "robot", "set-up", "people", "episodes", "success, %", "SD, %", "SE, %", "simulated time ± SE, s",
        "interaction force ± SE",
    ]  # fmt: skip
    published = any(row["published"] for row in rows)
    heads += ["published: success, %", "published: SD (printed as SD), %", "published: SE, %"] if published else []
    lines = []
    for row in rows:
        success, paper = row["success"], row["published"]
        lines.append(
            [
                row["robot"],
                row["front"].replace("_", " "),
                str(success["participants"]),
                str(row["episodes"]),
                *(_number(success[name], 100, 1) for name in ("mean", "sd", "standard_error")),
                mean_text(row["time_s"], 1, 1),
                mean_text(row["interaction_mean"], 1, 3),
                *(_published_spread(paper) if published else []),
            ]
        )
    return _without(heads, lines, "interaction force ± SE" if "interaction_force" in missing else "")


def _published_results(row: Mapping[str, Any]) -> list[str]:
    paper = row["published"]
    success = " ".join(filter(None, (_paper(paper, "success", 100, ".0f"), _method(row))))
    return [success, _paper(paper, "wall_time_s", 1, ".1f"), _paper(paper, "planning_ms", 1, "g")]


def _published_spread(paper: Mapping[str, Any]) -> list[str]:
    if not paper:
        return ["", "", ""]
    success, deviation, printed = (100 * paper[name] for name in ("success", "sd", "printed_sd"))
    return [f"{success:.1f}", f"{deviation:.1f} ({printed:.1f})", f"{deviation / paper['people'] ** 0.5:.1f}"]


def _questionnaires(rows: Sequence[Mapping[str, Any]]) -> str:
    robots = list(rows[0]["robots"])
    scored = {_form(row) for row in rows if row["kind"] == "score"}
    lines = []
    for row in rows:
        if row["kind"] == "item" and _form(row) in scored:
            continue  # its items are in the CSV and the JSON
        scale = "" if row["scale"] is None else f" ({row['scale'][0]:g} to {row['scale'][1]:g})"
        alpha = row.get("alpha")
        test = row["test"]
        lines.append(
            [
                f"{row['title']}{scale}",
                *(mean_text(row["robots"][name] or {"mean": None}, 1, 2) for name in robots),
                "" if alpha is None else f"{alpha:.2f}",
                "" if test is None else f"{test['test']}, p {_p(test['p'])}",
            ]
        )
    return markdown_table(["question, mean ± SE", *robots, "Cronbach's alpha", "differences"], lines)


def _form(row: Mapping[str, Any]) -> str:
    """The name of a question's questionnaire."""
    return row["question"].partition(".")[0]


def _tests(tests: Mapping[str, Any]) -> str:
    """The analysis of variance and the contrasts of each measure, one line each."""
    lines = []
    for measure, test in tests.items():
        name = _NAMES.get(measure, measure)
        if not test["anova"]:
            lines.append(
                f"- {name}: no test; it needs at least two people with a value in every cell, and some spread."
            )
            continue
        effects = "; ".join(
            f"{effect['source']} F({effect['df'][0]}, {effect['df'][1]}) = {effect['F']:.2f}, p {_p(effect['p'])} "
            f"(Greenhouse-Geisser {_p(effect['p_greenhouse_geisser'])}), partial eta² "
            f"{effect['partial_eta_squared']:.2f}"
            for effect in test["anova"]
        )
        lines.append(f"- {name}: {effects}; of {len(test['units'])} people; recommended: {test['recommended']}.")
        kind = "wilcoxon" if test["recommended"] == "rank tests" else "paired_t"
        for question, pairs in test["contrasts"].items():
            differences = ", ".join(_contrast(pair, kind) for pair in pairs if pair[kind] is not None)
            if differences:
                lines.append(f"  - {question} (p with Holm's correction): {differences}.")
    return "\n".join(lines)


def _contrast(pair: Mapping[str, Any], kind: str) -> str:
    at = f"{pair['at']}: " if "at" in pair else ""
    return f"{at}{pair['first']} - {pair['second']} {pair['difference']:+.3f}, p {_p(pair[kind]['p_holm'])}"


def csv_text(table: Mapping[str, Any]) -> str:
    """One line per table, robot, set-up and measure; rates are fractions, times seconds."""
    file = io.StringIO()
    writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    label = table["source"] if table["source"] == "human" else "simulated, no person took part"
    for name, rows in (("robots", table["robots"]), ("fronts", table["fronts"])):
        for row in rows:
            for measure in MEASURES:
                paper = row["published"]
                values = {
                    "table": name, "label": label, "robot": row["robot"], "front": row.get("front", ""),
                    "measure": measure, **row[measure], "episodes": row["episodes"],
                    "published": paper.get(measure), "published_sd": paper.get("sd") if measure == "success" else None,
                }  # fmt: skip
                writer.writerow(values)
    for row in table["questionnaires"]:
        for robot, cell in row["robots"].items():
            values = {"table": "questionnaires", "label": label, "robot": robot, "measure": row["question"]}
            writer.writerow({name: (values | (cell or {})).get(name) for name in _COLUMNS})
    return file.getvalue()


_COLUMNS = (
    "table", "label", "robot", "front", "measure", "mean", "sd", "standard_error", "participants", "episodes",
    "published", "published_sd",
)  # fmt: skip


def _without(heads: list[str], lines: list[list[str]], head: str) -> str:
    """The table without a column; with all if `head` is empty."""
    if not head:
        return markdown_table(heads, lines)
    index = heads.index(head)
    return markdown_table(heads[:index] + heads[index + 1 :], [line[:index] + line[index + 1 :] for line in lines])


def _with_deviation(cell: Mapping[str, Any]) -> str:
    text = mean_text(cell, 100, 1)
    return text if cell["sd"] is None else f"{text} ({100 * cell['sd']:.1f})"


def _number(value: float | None, scale: float, digits: int) -> str:
    return "" if value is None else f"{scale * value:.{digits}f}"


def _method(row: Mapping[str, Any]) -> str:
    """The published method in brackets, where the robot has another name."""
    method = row["published"].get("method")
    return f"({method})" if method and method != row["robot"] else ""


def _paper(paper: Mapping[str, Any], name: str, scale: float, form: str) -> str:
    value = paper.get(name)
    return "" if value is None else format(scale * value, form)


def _p(value: float) -> str:
    return f"< {_P_SMALLEST:g}" if value < _P_SMALLEST else f"{value:.4f}"


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."
