"""Scores of methods of which a cross-play has several training seeds."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.policies.training_run import find_policy_folder

from ..coplanning_table.training_runs import read_trained_methods
from ..partner_study.robots import HIDDEN_OPTION, split_robot
from .measures import MEASURES, Row, mean_and_error, over_partners
from .score import Cells, gave_way, partner_scores


def with_seeds(texts: Sequence[str], scripted: Sequence[str]) -> tuple[list[str], dict[str, list[str]]]:
    """Replaces each folder that has several training runs by these runs, as robots `NAME-SEED`.

    Args:
        texts: values of `--robots`.
        scripted: values that are no checkpoints.

    Returns:
        The robots, and of each method the names of its robots.

    Raises:
        FileFormatError: runs of one folder are of different methods, or the same training twice.
        InvalidValueError: two methods have one name.
    """
    robots: list[str] = []
    methods: dict[str, list[str]] = {}
    for text in texts:
        name, path, hides = ("", "", False) if text in scripted else split_robot(text)
        if not path or not Path(path).is_dir() or find_policy_folder(Path(path)) is not None:
            robots.append(text)
            continue
        (method,) = read_trained_methods([f"{name}={path}" if name else path])
        if method.name in methods:
            raise InvalidValueError(
                "--robots", "methods of different names (NAME=DIR gives one)", f"{method.name} twice"
            )
        option = HIDDEN_OPTION if hides else ""
        named = {f"{method.name}-{_label(run.seed, index)}": run.folder for index, run in enumerate(method.runs)}
        robots += [f"{robot}={folder}{option}" for robot, folder in named.items()]
        methods[method.name] = list(named)
    return robots, methods


def _label(seed: int | None, index: int) -> str:
    return f"run{index}" if seed is None else str(seed)


def method_scores(
    methods: Mapping[str, Sequence[str]],
    scores: Mapping[str, Any],
    rows: Cells,
    own_rows: Mapping[str, Sequence[Row]],
    floors: Sequence[str],
) -> dict[str, dict[str, Any]]:
    """Scores of methods and their differences.

    Args:
        methods: robots of each method, one per training seed.
        scores: result of `partner_scores` for the robots.
        rows: rows by robot and partner.
        own_rows: rows of each partner's own kind.
        floors: robots from which methods are to be told apart.

    Returns:
        For each method its robots, mean and standard error over training seeds of the score and of success in time,
        and `differences` and `gave_way_differences`: its score and the proportion of `gave_way` minus those of the
        first method and of the floors, with all seeds of a method pooled and a bootstrap over maps.
    """
    if not methods:
        return {}
    by_robot = scores.get("robots", {})
    first = next(iter(methods))
    pooled = {name: _pooled([rows[robot] for robot in robots]) for name, robots in methods.items()}
    cells = {**pooled, **{floor: rows[floor] for floor in floors}}
    differences: dict[str, dict[str, Any]] = {name: {} for name in methods}
    yielding: dict[str, dict[str, Any]] = {name: {} for name in methods}
    for others in ([first], floors):
        found = partner_scores(cells, own_rows, list(methods), others)
        for name, separation in found.get("separation", {}).items():
            differences[name] |= separation
        for name, separation in gave_way(cells, list(methods), others).get("separation", {}).items():
            yielding[name] |= separation
    result = {}
    for name, robots in methods.items():
        seeds = [by_robot[robot] for robot in robots if robot in by_robot]
        result[name] = {
            "robots": list(robots),
            "score": mean_and_error([score["mean"] for score in seeds]),
            "in_time": mean_and_error([score["in_time"] for score in seeds]),
            "differences": differences[name],
            "gave_way_differences": yielding[name],
        }
    return result


def method_measures(
    methods: Mapping[str, Sequence[str]], summaries: Mapping[str, Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Of each method, mean and standard error over training seeds of each measure (of a seed: mean over partners).

    Args:
        summaries: measures of the cells by robot and partner.
    """
    return {
        name: {
            measure: mean_and_error(
                [mean for mean in (over_partners(summaries[robot], measure) for robot in robots) if mean is not None]
            )
            for measure in MEASURES
        }
        for name, robots in methods.items()
    }


def _pooled(robots: Sequence[Mapping[str, Sequence[Row]]]) -> dict[str, list[Row]]:
    """Rows of all seeds of a method by partner."""
    return {partner: [row for robot in robots for row in robot[partner]] for partner in robots[0]}
