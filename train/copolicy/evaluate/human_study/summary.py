"""Summary of a human study: measures of each robot, and tests of differences between robots within persons."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import TABLE, get_task

from ..comparison.paired import between_runs
from ..summary import not_measured, success_rate
from ..within_subject.analysis import DEFINITIONS, analyse
from ..within_subject.anova import rank_test
from ..within_subject.measurements import Measurements
from ..within_subject.mixed_logistic import mixed_logistic
from .ratings import questions

LABELS = {
    "human": "human-in-the-loop study: people at the human seat",
    "simulated": "SIMULATED: a scripted player sat at the human seat, no person took part; a trial of the procedure",
}
_ROBOTS = (
    "mean over participants of a participant's mean; sd and standard error (sd / square root of the participants) "
    "between participants; times of successes only"
)
_DEFINITIONS = {
    "unit_of_analysis": "the participant: mean of a participant's episodes with a robot; only participants who have a "
    "value with every robot",
    **DEFINITIONS,
    "time_s": "simulated time: steps / rate",
    "wall_time_s": "by the clock, from the first step to the end of the last, without pauses",
    "planning_ms": "mean time until an action chunk is there, with the way to the policies' process and back",
    "fronts": "robot x set-up; a participant without a value in every cell is left out of the test, by name",
    "ratings": "Friedman's test, with two robots Wilcoxon's signed-rank test, over participants who rated every robot",
}
_MEASURES = ("success", "time_s", "wall_time_s", "interaction_mean", "interaction_p95", "planning_ms")
_TESTED = ("success", "time_s", "interaction_mean")


def summarise_study(rows: Sequence[Mapping[str, Any]], ratings: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """The content of the study's result, without its episodes.

    Raises:
        RunError: the rows have several sources (such as people and simulated players) or several tasks.
    """
    sources, tasks = sorted({row["source"] for row in rows}), sorted({row.get("task", TABLE) for row in rows})
    for column, values in (("source", sources), ("task", tasks)):
        if len(values) > 1:
            raise RunError(f"recordings: expected one {column}, found {' and '.join(values)}: summarise them apart")
    task, has_force = get_task(tasks[0]), any(row["interaction_mean"] is not None for row in rows)
    robots = list(dict.fromkeys(sorted(row["robot"] for row in rows)))
    people = list(dict.fromkeys(sorted(row["participant"] for row in rows)))
    tests = {measure: _tests(rows, measure) for measure in _TESTED[: 3 if has_force else 2]}
    result: dict[str, Any] = {
        "label": LABELS.get(sources[0], f"recordings of source {sources[0]}"),
        "source": sources[0],
        "participants": people,
        "robots": {
            robot: {
                "episodes": sum(row["robot"] == robot for row in rows),
                "pooled_success": success_rate([bool(row["success"]) for row in rows if row["robot"] == robot]),
                **_measures([row for row in rows if row["robot"] == robot], people),
            }
            for robot in robots
        },
        **_by_front(rows, robots, people, task.studies.fronts),
        "tests": tests,
        "mixed_logistic": mixed_logistic(rows, "robot", ("participant", "map_id")) if _has_groups(rows) else None,
    }
    if ratings:
        result["ratings"] = _ratings(ratings)
    if not has_force:
        definitions, missing = {"robots": _ROBOTS, **_DEFINITIONS}, not_measured(task, {"interaction_force": None})
        return {**result, **missing, "definitions": definitions}
    force = task.studies.definitions.get("human_interaction_force", "as the task measures it")
    return {**result, "definitions": {"robots": f"{_ROBOTS}; interaction force {force}", **_DEFINITIONS}}


def _by_front(
    rows: Sequence[Mapping[str, Any]], robots: Sequence[str], people: Sequence[str], fronts: Sequence[str]
) -> dict[str, Any]:
    """Measures of each robot in each set-up and the tests of robot x set-up; empty without rows in two set-ups."""
    used = [front for front in fronts if any(row.get("front") == front for row in rows)]
    if len(used) < 2:
        return {}
    counted = [row for row in rows if row.get("front") in used]
    cells = {
        robot: {
            front: {
                "episodes": sum((row["robot"], row["front"]) == (robot, front) for row in counted),
                **_measures([row for row in counted if (row["robot"], row["front"]) == (robot, front)], people),
            }
            for front in used
        }
        for robot in robots
    }
    measures = [name for name in _TESTED if any(row[name] is not None for row in counted)]
    return {"fronts": cells, "front_tests": {name: _tests(counted, name, ("robot", "front")) for name in measures}}


def _measures(rows: Sequence[Mapping[str, Any]], people: Sequence[str]) -> dict[str, dict[str, Any]]:
    return {measure: _between([_mean(rows, measure, person) for person in people]) for measure in _MEASURES}


def _tests(rows: Sequence[Mapping[str, Any]], measure: str, factors: Sequence[str] = ("robot",)) -> dict[str, Any]:
    """The within-subject analysis of a measure; the time of a failure is no time to completion."""
    counted = [row for row in rows if row["success"] or measure != "time_s"]
    robots = sorted({row["robot"] for row in rows})
    ordered = sorted(counted, key=lambda row: robots.index(row["robot"]))
    if {row["robot"] for row in counted} != set(robots):
        return {"unit_of_analysis": "none: a robot has no value", "units": [], "anova": None, "contrasts": {}}
    analysis = analyse(Measurements.of_rows(ordered, measure, "participant", factors))
    return {name: value for name, value in analysis.items() if name not in ("definitions", "measure", "cells")}


def _has_groups(rows: Sequence[Mapping[str, Any]]) -> bool:
    """Whether a mixed model has at least two robots, and several people or maps."""
    return len({row["robot"] for row in rows}) > 1 and any(
        len({row.get(column) for row in rows}) > 1 for column in ("participant", "map_id")
    )


def _ratings(ratings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    robots = list(dict.fromkeys(sorted(row["robot"] for row in ratings)))
    people = list(dict.fromkeys(sorted(row["participant"] for row in ratings)))
    results = {}
    for question in questions(ratings):

        def answer(person: str, robot: str, question: str = question) -> float:
            for row in ratings:
                if (row["participant"], row["robot"]) == (person, robot) and row.get(question) is not None:
                    return row[question]
            return float("nan")

        results[question] = {
            "robots": {robot: _between([answer(person, robot) for person in people]) for robot in robots},
            "test": rank_test(_complete(people, robots, answer)),
        }
    return results


def mean_text(cell: Mapping[str, Any], scale: float, digits: int, unit: str = "") -> str:
    """A mean of `summarise_study` with its standard error, such as "75.0 ± 11.2 %"; "none" without a value.

    Args:
        scale: factor of both numbers.
        digits: after the decimal point.
    """
    if cell["mean"] is None:
        return "none"
    error = cell["standard_error"]
    spread = "" if error is None else f" ± {scale * error:.{digits}f}"
    return f"{scale * cell['mean']:.{digits}f}{spread}{unit}"


def _between(values: Sequence[float]) -> dict[str, Any]:
    spread, known = between_runs(values), [value for value in values if np.isfinite(value)]
    return {
        "mean": spread["mean"],
        "sd": float(np.std(known, ddof=1)) if len(known) > 1 else None,
        "standard_error": spread["standard_error"],
        "participants": spread["runs"],
    }


def _mean(rows: Sequence[Mapping[str, Any]], measure: str, person: str) -> float:
    """A participant's mean of a measure; nan without values."""
    values = [
        float(row[measure])
        for row in rows
        if row["participant"] == person
        and row.get(measure) is not None
        and (row["success"] or measure not in ("time_s", "wall_time_s"))
    ]
    return float(np.mean(values)) if values else float("nan")


def _complete(people: Sequence[str], robots: Sequence[str], value: Callable[[str, str], float]) -> Array:
    """Values `(n, k)` of the participants who have a value with every robot."""
    values = np.array([[value(person, robot) for robot in robots] for person in people]).reshape(-1, len(robots))
    return values[np.isfinite(values).all(axis=1)]
