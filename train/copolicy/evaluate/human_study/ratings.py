"""The participants' ratings of each block: answers given in the window, a CSV or JSON file, or both."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from copolicy.collect.questionnaire import answers_in
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError

from .plan import StudyPlan

_KEYS = ("participant", "block")
_EXPECTED = "ratings with the columns participant, block and one for each question"


def study_ratings(
    folders: Sequence[Path], plan: StudyPlan | None, file: Path | None, source: str
) -> list[dict[str, Any]]:
    """The ratings of a study: answers in the folders of its sessions, completed by a file, with scores.

    Args:
        folders: of recordings.
        plan: of the study; without one there are no ratings, since it names the robot of each block.
        file: see `read_ratings`.
        source: of the recordings, `human` or `simulated`.

    Returns:
        One dict per rated block: participant, block, robot, the answer to each question, and scores whose items were
        all answered. Questions and scores of a questionnaire have the keys `questionnaire.name`.

    Raises:
        InvalidValueError: a file without a plan.
        FileFormatError: a file is damaged, or contradicts an answer or the plan.
        RunError: answers and recordings have different sources.
    """
    if plan is None:
        if file:
            raise InvalidValueError("--ratings", "--plan too, which names the robot of each block", "none")
        return []
    answered = _answers(folders, plan, source)
    for row in read_ratings(file, plan) if file else ():
        own = answered.setdefault((row["participant"], row["block"]), row)
        for question, value in row.items():
            earlier = own.get(question)
            if earlier is None:
                own[question] = value
            elif value is not None and value != earlier:
                block = f"{row['participant']} block {row['block']}"
                raise FileFormatError(file or "", f"{question} {earlier:g} of {block}, as answered then", f"{value:g}")
    return [_scored(row, plan) for row in answered.values()]


def _answers(folders: Sequence[Path], plan: StudyPlan, source: str) -> dict[tuple[str, int], dict[str, Any]]:
    """Answers of the plan's participants by participant and block; the newest to each question counts."""
    found = sorted(
        ((path, answer) for folder in folders for path, answer in answers_in(folder) if answer.study == plan.plan_id),
        key=lambda entry: entry[1].time,
    )
    rows: dict[tuple[str, int], dict[str, Any]] = {}
    for path, answer in found:
        robot = plan.trials.get(answer.participant) and plan.blocks_of(answer.participant).get(answer.block)
        if not robot:
            block = f"{answer.participant} block {answer.block}"
            raise FileFormatError(path, f"blocks of plan {plan.plan_id}", block)
        if answer.source != source:
            raise RunError(f"{path}: expected answers of source {source}, as the recordings, found {answer.source}")
        key = answer.participant, answer.block
        row = rows.setdefault(key, {"participant": answer.participant, "block": answer.block, "robot": robot})
        row[f"{answer.questionnaire}.{answer.item}"] = answer.value
    return rows


def _scored(row: dict[str, Any], plan: StudyPlan) -> dict[str, Any]:
    scores = {}
    for form in plan.questionnaires:
        answers = {item.name: row.get(form.key(item.name)) for item in form.items}
        if any(value is not None for value in answers.values()):
            scores |= {form.key(score.name): form.score(score, answers) for score in form.scores}
    return {**row, **scores}


def read_ratings(path: Path, plan: StudyPlan) -> list[dict[str, Any]]:
    """Reads a CSV with a header, or a JSON list of objects; an empty answer is None.

    Returns:
        One dict per rated block: participant, block, robot (from the plan), and the answer to each question.

    Raises:
        FileFormatError: the file does not exist, a column is missing, an answer is no number, or a block is not planned
            or rated twice.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        rows = json.loads(text) if path.suffix == ".json" else list(csv.DictReader(text.splitlines()))
    except OSError as error:
        raise FileFormatError(path, _EXPECTED, error.strerror or str(error)) from None
    except ValueError as error:
        raise FileFormatError(path, _EXPECTED, f"no JSON ({error})") from None
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise FileFormatError(path, _EXPECTED, "no rows")
    robots = {(name, trial.block): trial.robot for name, trials in plan.trials.items() for trial in trials}
    ratings: dict[tuple[str, int], dict[str, Any]] = {}
    for number, row in enumerate(rows, 1):
        missing = [key for key in _KEYS if not row.get(key)]
        if missing:
            raise FileFormatError(path, _EXPECTED, f"no {' and '.join(missing)} in row {number}")
        block = _number(path, number, "block", row["block"])
        key = participant, block = str(row["participant"]).strip(), int(block or 0)
        if key not in robots:
            raise FileFormatError(
                path, f"blocks of plan {plan.plan_id}", f"{participant} block {block} in row {number}"
            )
        if key in ratings:
            raise FileFormatError(path, "each block once", f"{participant} block {block} again in row {number}")
        answers = {
            str(question): _number(path, number, question, answer)
            for question, answer in row.items()
            if question not in _KEYS and question is not None
        }
        ratings[key] = {"participant": participant, "block": block, "robot": robots[key], **answers}
    return list(ratings.values())


def questions(ratings: Sequence[Mapping[str, Any]]) -> list[str]:
    """The questions, in the order of the file."""
    return list(dict.fromkeys(key for row in ratings for key in row if key not in (*_KEYS, "robot")))


def _number(path: Path, row: int, question: str, answer: Any) -> float | None:
    if answer is None or str(answer).strip() == "":
        return None
    try:
        number = float(answer)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise FileFormatError(path, f"a number for {question!r} in row {row}", repr(answer))
    return number
