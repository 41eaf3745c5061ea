"""The content of the tables: measures of each robot and set-up beside the published ones, questionnaires, tests."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from copolicy.collect.questionnaire import Questionnaire
from copolicy.dataset.task import PublishedMethod

from ..human_study.plan import StudyPlan
from ..human_study.summary import summarise_study

STUDY = "human table"
"""Name of the study in `table.json`."""

MEASURES = ("success", "time_s", "wall_time_s", "interaction_mean", "planning_ms")
"""Columns of the tables."""

_UNIT = (
    "the participant; a participant's episodes with a robot (and set-up) give one mean, and every "
    "spread is between these means: sd, and standard error = sd / square root of the number of participants"
)


def human_table(
    rows: Sequence[Mapping[str, Any]],
    ratings: Sequence[Mapping[str, Any]],
    plan: StudyPlan,
    left_out: Mapping[str, int],
) -> dict[str, Any]:
    """The tables of a study as data that can be written as JSON.

    Args:
        rows: of the counted episodes, see `study_rows`.
        ratings: of the blocks, see `study_ratings`.
        left_out: number of further recordings by the reason for which they are left out.

    Raises:
        RunError: the rows have several sources (such as people and simulated players).
    """
    summary = summarise_study(rows, ratings)
    studies = plan.task.studies
    published = {method.name: method for method in studies.published if method.people is not None}
    # A robot of a plan that does not state the method is recognised by its name.
    methods = {robot.name: published.get(robot.method or robot.name) for robot in plan.robots}
    robots = [robot.name for robot in plan.robots if robot.name in summary["robots"]]
    missing = [robot.name for robot in plan.robots if robot.name not in summary["robots"]]
    starts = {row["map_id"] for row in rows}
    return {
        "study": STUDY,
        "label": summary["label"],
        "source": summary["source"],
        "unit_of_analysis": _UNIT,
        "settings": {
            "plan_id": plan.plan_id,
            "task": plan.task.spec.name,
            "maps": plan.maps,
            "starts": len(starts),
            "step_limit": plan.world_settings.step_limit,
            "actions_per_plan": plan.actions_per_plan,
            "policies": plan.settings,
        },
        "participants": summary["participants"],
        "planned": sum(len(trials) for trials in plan.trials.values()),
        "robots": [_row(name, summary["robots"][name], _simulation(methods[name])) for name in robots],
        "robots_without_episodes": missing,
        "left_out": dict(left_out),
        "fronts": [
            {"front": front, **_row(name, cell, _real_robot(methods[name], front))}
            for name in (robots if "fronts" in summary else ())
            for front, cell in summary["fronts"][name].items()
        ],
        "questionnaires": _questionnaires(summary, ratings, plan.questionnaires, robots),
        "tests": {
            "robots": summary["tests"],
            "fronts": summary.get("front_tests", {}),
            "mixed_logistic": summary["mixed_logistic"],
        },
        "published_source": studies.published_people_source if any(methods.values()) else "",
        "definitions": summary["definitions"],
        **({"not_measured": summary["not_measured"]} if "not_measured" in summary else {}),
    }


def _row(name: str, measures: Mapping[str, Any], published: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "robot": name,
        "episodes": measures["episodes"],
        **{measure: measures[measure] for measure in MEASURES},
        "published": dict(published),
    }


def _simulation(method: PublishedMethod | None) -> dict[str, Any]:
    """A method's published results of the study in simulation."""
    if method is None or method.people is None:
        return {}
    people = method.people
    planning = method.planning_ms
    return {
        "method": method.name,
        "success": people.success,
        "wall_time_s": people.wall_time_s,
        "planning_ms": planning,
    }


def _real_robot(method: PublishedMethod | None, front: str) -> dict[str, Any]:
    """A method's published success with one end in front, of the study with a real robot."""
    if method is None or method.people is None or front not in method.people.fronts:
        return {}
    cell = method.people.fronts[front]
    return {"method": method.name, "success": cell.successes / cell.trials, **cell._asdict()}


def _questionnaires(
    summary: Mapping[str, Any],
    ratings: Sequence[Mapping[str, Any]],
    forms: Sequence[Questionnaire],
    robots: Sequence[str],
) -> list[dict[str, Any]]:
    """Every question and score with the means of each robot; scores first, then items, then questions of a file."""
    rated: dict[str, Any] = summary.get("ratings", {})
    rows = []
    known: set[str] = set()
    for form in forms:
        for score in form.scores:
            items = [form.key(name) for name in score.items]
            alpha = _cronbach_alpha(
                [[_mirrored(form, name, row.get(form.key(name))) for name in score.items] for row in ratings]
            )
            rows.append((form, form.key(score.name), score.title, "score", {"items": items, "alpha": alpha}))
        for item in form.items:
            rows.append((form, form.key(item.name), item.title or item.text, "item", {"reversed": item.reversed}))
        known |= {key for _, key, *_ in rows}
    rows += [(None, question, question, "file", {}) for question in rated if question not in known]
    return [
        {
            "question": key,
            "title": title,
            "kind": kind,
            "questionnaire": form.title if form else "",
            "source": form.source if form else "",
            "scale": [form.scale.low, form.scale.high] if form else None,
            **more,
            "robots": {name: rated[key]["robots"].get(name) for name in robots},
            "test": rated[key]["test"],
        }
        for form, key, title, kind, more in rows
        if key in rated
    ]


def _mirrored(form: Questionnaire, name: str, value: float | None) -> float:
    item = next(item for item in form.items if item.name == name)
    if value is None:
        return float("nan")
    return form.scale.low + form.scale.high - value if item.reversed else value


def _cronbach_alpha(answers: Sequence[Sequence[float]]) -> float | None:
    """Cronbach's alpha of items over rated blocks without a missing answer; None for fewer than three, or one item."""
    values = np.array(answers, float).reshape(len(answers), -1)
    values = values[np.isfinite(values).all(axis=1)]
    count = values.shape[1]
    if len(values) < 3 or count < 2:
        return None
    total = values.sum(axis=1).var(ddof=1)
    if total == 0:
        return None
    return float(count / (count - 1) * (1 - values.var(axis=0, ddof=1).sum() / total))
