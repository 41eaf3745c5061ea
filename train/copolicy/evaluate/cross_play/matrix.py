"""The result of a cross-play from its cells: measures, scores, what is missing and why."""

from collections.abc import Mapping, Sequence
from typing import Any

from copolicy.dataset.task import PairTask

from ..partner_study.robots import StudyRobot
from ..partners.partner import StudyPartner
from .cells import OWN_KIND
from .factors import by_factor
from .measures import definitions, not_measured, own_kind_of_start, summary
from .methods import method_measures, method_scores
from .score import FACTOR, gave_way, partner_scores


def matrix_result(
    task: PairTask,
    settings: dict[str, Any],
    robots: Sequence[StudyRobot],
    partners: Sequence[StudyPartner],
    cells: dict[str, dict[str, Any]],
    floors: Sequence[str],
    methods: Mapping[str, Sequence[str]],
    factors: Sequence[str],
) -> dict[str, Any]:
    """The entries of `matrix.json` other than study, label and overlap.

    Args:
        settings: the `settings` entry.
        cells: documents of the cells by robot and partner, with the row `own-kind`.
        floors: names of the robots from which the others are to be told apart.
        methods: names of the robots of each method that has several training seeds.
        factors: of the task's scenarios, see `Studies.factors`.
    """
    own = cells[OWN_KIND]
    times = {partner.name: own_kind_of_start(own[partner.name]["episodes"] if partner.name in own else None)
             for partner in partners}  # fmt: skip
    summaries = {
        robot: {
            partner: {
                "measures": summary(cell["episodes"], times[partner]),
                "wall_s": cell["wall_s"],
                "planning_ms_per_call": cell["planning_ms_per_call"],
                "episodes": len(cell["episodes"]),
            }
            for partner, cell in row.items()
        }
        for robot, row in cells.items()
        if row
    }
    rows = {robot: {name: cell["episodes"] for name, cell in row.items()} for robot, row in cells.items() if row}
    scored = {
        robot: row for robot, row in rows.items() if robot != OWN_KIND or set(row) == {each.name for each in partners}
    }
    own_rows = {name: cell["episodes"] for name, cell in own.items()}
    names = [robot.name for robot in robots]
    scores = partner_scores(scored, own_rows, names, floors)
    of_methods, measured = method_scores(methods, scores, rows, own_rows, floors), method_measures(methods, summaries)
    missing = {each.name: each.no_own_kind for each in partners if each.own_kind is None}
    missing |= {
        name: "left out of the score: its own kind never succeeded"
        for name, episodes in own_rows.items()
        if not any(row["success"] for row in episodes)
    }
    score_text = (
        f"proportion of episodes that succeed within {FACTOR:g} times the median time of the partner's own kind with "
        f"itself on that map, at a mean interaction force of at most {FACTOR:g} times its median there (if the task "
        "measures it), mean over partners; success in time: the same without the force; standard error and interval "
        "from a bootstrap over maps; first in: proportion of the replicates in which the robot's score is the largest; "
        "own-kind is not ranked"
    )
    return {
        "settings": {
            **settings,
            "episodes_per_cell": settings["configurations"] * settings["repeats"],
            "length_unit": task.outline.unit if task.outline else "",
        },
        "robots": {robot.name: robot.describe() for robot in robots},
        "partners": {partner.name: partner.describe() for partner in partners},
        "floors": list(floors),
        "scores": scores,
        "gave_way": gave_way(rows, names, floors),
        "methods": {name: {**entry, "measures": measured[name]} for name, entry in of_methods.items()},
        "by_factor": by_factor(factors, scored, own_rows, names, floors, methods),
        "cells": summaries,
        "definitions": {"score": score_text, **definitions(task)},
        "not_measured": not_measured(task, summaries),
        "no_own_kind": missing,
    }
