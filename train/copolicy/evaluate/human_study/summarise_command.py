"""`copolicy-eval human summarise`."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.files.staging import replace_json, require_new

from ..study_flags import task_entry

if TYPE_CHECKING:
    from .plan import StudyPlan


def add_summarise(steps: Commands) -> None:
    """Adds `human summarise`."""
    command = add_command(
        steps,
        "summarise",
        _summarise,
        "success, time, interaction force and ratings of each robot, with the paper's tests of their differences",
        "copolicy-eval human summarise study/recordings --plan study/plan.json --ratings study/ratings.csv "
        "--out study/result.json",
    )
    command.add_argument("recordings", type=Path, help="folder of sessions; answers in their folders are read too")
    command.add_argument("--plan", type=Path, help="study plan (default: robots are named as in the recordings)")
    add_ratings_flag(command)
    command.add_argument("--out", type=Path, help="write the summary and all episodes as JSON")
    command.add_argument("--overwrite", action="store_true", help="replace an existing result")


class RecordedStudy(NamedTuple):
    """A study as far as it was recorded.

    Attributes:
        plan: None if robots are named as in the recordings.
        rows: of the counted episodes, see `study_rows`.
        left_out: number of further recordings by the reason for which they are left out.
        ratings: of the blocks, see `study_ratings`.
    """

    plan: "StudyPlan | None"
    rows: list[dict[str, Any]]
    left_out: dict[str, int]
    ratings: list[dict[str, Any]]


def add_ratings_flag(command: argparse.ArgumentParser) -> None:
    """Adds `--ratings`."""
    command.add_argument(
        "--ratings",
        type=Path,
        metavar="FILE",
        help="CSV or JSON with participant, block and one column per question, beside the answers given in the window",
    )


def read_study(folders: Sequence[Path], plan_file: Path | None, ratings_file: Path | None) -> RecordedStudy:
    """Reads a study; a wrong plan or file of ratings is reported before the recordings are read.

    Args:
        folders: of recordings.

    Raises:
        InvalidValueError: ratings without a plan.
        FileFormatError: a file is damaged or contradicts the plan, or a folder has no recordings.
        RunError: no episode counts, or answers and recordings have different sources.
    """
    from .plan import StudyPlan
    from .ratings import read_ratings, study_ratings
    from .recordings import study_rows

    if ratings_file and not plan_file:
        raise InvalidValueError("--ratings", "--plan too, which names the robot of each block", "none")
    for folder in folders:
        if not folder.is_dir() or not visible_files(folder, "*.mcap"):
            raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    plan = StudyPlan.read(plan_file) if plan_file else None
    rated = read_ratings(ratings_file, plan) if plan and ratings_file else []
    rows, left_out = study_rows(folders, plan)
    ratings = study_ratings(folders, plan, rated, ratings_file, rows[0]["source"]) if plan else []
    return RecordedStudy(plan, rows, left_out, ratings)


def _summarise(arguments: argparse.Namespace) -> dict[str, Any]:
    from .summary import summarise_study

    if arguments.out:
        require_new(arguments.out, overwrite=arguments.overwrite)
    plan, rows, left_out, ratings = read_study([arguments.recordings], arguments.plan, arguments.ratings)
    summary = summarise_study(rows, ratings)
    planned = sum(len(trials) for trials in plan.trials.values()) if plan else None
    counts = {"episodes": len(rows), "planned": planned, "left_out": left_out}
    if arguments.out:
        settings = (
            {}
            if plan is None
            else {
                **task_entry(plan.task),
                "plan_id": plan.plan_id,
                "maps": plan.maps,
                **plan.map_set,
                "step_limit": plan.world_settings.step_limit,
            }
        )
        result = {"study": "human", "settings": settings, **summary, **counts, "rows": rows, "answers": ratings}
        replace_json(arguments.out, result, indent=1)
        counts["result"] = str(arguments.out)
    if arguments.json:
        return {**summary, **counts}
    return {"label": summary["label"], **counts, **_report(summary)}


def _report(summary: dict) -> dict[str, Any]:
    robots = {}
    for name, robot in summary["robots"].items():
        robots[name] = {"success": _value(robot["success"], 100, 1, " %"), "time": _value(robot["time_s"], 1, 2, " s")}
        if "interaction_mean" in summary["tests"]:
            robots[name]["interaction_force"] = _value(robot["interaction_mean"], 1, 4, "")
    tests = {}
    for measure, test in summary["tests"].items():
        effects = test["anova"]
        if not effects:
            tests[measure] = "no test: it needs at least two people with a value for every robot, and some spread"
            continue
        f, n = effects[0], len(test["units"])
        tests[measure] = (
            f"F({f['df'][0]}, {f['df'][1]}) = {f['F']:.2f}, p = {f['p']:.3g}, Greenhouse-Geisser "
            f"{f['p_greenhouse_geisser']:.3g}, of {n} people; recommended: {test['recommended']}"
        )
    by_front = {
        name: {front: _value(cell["success"], 100, 1, " %") for front, cell in cells.items()}
        for name, cells in summary.get("fronts", {}).items()
    }
    ratings = {
        question: {robot: _value(rating, 1, 2, "") for robot, rating in answers["robots"].items()}
        for question, answers in summary.get("ratings", {}).items()
    }
    missing = {name: summary[name] for name in ("not_measured",) if name in summary}
    fronts = {"success_by_front": by_front} if by_front else {}
    return {"robots": robots, **fronts, "anova": tests, **({"ratings": ratings} if ratings else {}), **missing}


def _value(measure: dict, scale: float, digits: int, unit: str) -> str:
    from .summary import mean_text

    people = "" if measure["mean"] is None else f" (of {measure['participants']} people)"
    return mean_text(measure, scale, digits, unit) + people
