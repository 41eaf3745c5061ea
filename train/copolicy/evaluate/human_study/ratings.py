"""The participants' ratings of each block: answers given in the window, a CSV or JSON file, or both."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from copolicy.collect.questionnaire import Answer, answers_in
from copolicy.dataset.exceptions import FileFormatError, RunError

from .plan import StudyPlan

_KEYS = ("participant", "block")
_EXPECTED = "ratings with the columns participant, block and one for each question"


def study_ratings(
    folders: Sequence[Path], plan: StudyPlan, rated: Sequence[dict[str, Any]], file: Path | None, source: str
) -> list[dict[str, Any]]:
    """The ratings of a study: answers in the folders of its sessions, completed by a file, with scores.

    Args:
        folders: of recordings.
        plan: of the study, which names the robot of each block.
        rated: the content of a file, see `read_ratings`.
        file: its path, for errors; None without one.
        source: of the recordings, `human` or `simulated`.

    Returns:
        One dict per rated block: participant, block, robot, the answer to each question, and scores whose items were
        all answered. Questions and scores of a questionnaire have the keys `questionnaire.name`.

    Raises:
        FileFormatError: a file of answers is damaged, or the ratings contradict an answer.
        RunError: answers and recordings have different sources.
    """
    answered = _answers(folders, plan, source)
    for row in rated:
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
    """Answers of the plan's participants by participant and block; the newest to each question counts.

    Within a file the last one is the newest, whatever the machine's clock said meanwhile.
    """
    files: dict[Path, list[Answer]] = {}
    for path, answer in (found for folder in folders for found in answers_in(folder)):
        if answer.study == plan.plan_id:
            files.setdefault(path, []).append(answer)
    sessions = sorted(files.items(), key=lambda session: session[1][0].time)
    found = [(path, answer) for path, answers in sessions for answer in answers]
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
        FileFormatError: the file does not exist, a column is missing, a row is longer than the header, an answer is no
            number or not on the scale of its question, a block is not planned or rated twice, or a column has the name
            of a questionnaire of the plan with none of its questions.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        rows = json.loads(text) if path.suffix == ".json" else list(csv.DictReader(text.splitlines()))
    except OSError as error:
        raise FileFormatError(path, _EXPECTED, error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        raise FileFormatError(path, _EXPECTED, f"invalid UTF-8 (byte {error.start})") from None
    except (ValueError, csv.Error, RecursionError) as error:
        raise FileFormatError(path, _EXPECTED, f"no {path.suffix.removeprefix('.').upper()} ({error})") from None
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise FileFormatError(path, _EXPECTED, "no rows")
    robots = {(name, trial.block): trial.robot for name, trials in plan.trials.items() for trial in trials}
    ratings: dict[tuple[str, int], dict[str, Any]] = {}
    for number, row in enumerate(rows, 1):
        missing = [key for key in _KEYS if not row.get(key)]
        if missing:
            raise FileFormatError(path, _EXPECTED, f"no {' and '.join(missing)} in row {number}")
        if None in row:  # such as a comma in a number
            raise FileFormatError(path, _EXPECTED, f"more values than columns in row {number}")
        block = _number(path, number, "block", row["block"]) or 0
        if block != int(block):
            raise FileFormatError(path, f"the number of a block in row {number}", repr(row["block"]))
        key = participant, block = str(row["participant"]).strip(), int(block)
        if key not in robots:
            raise FileFormatError(
                path, f"blocks of plan {plan.plan_id}", f"{participant} block {block} in row {number}"
            )
        if key in ratings:
            raise FileFormatError(path, "each block once", f"{participant} block {block} again in row {number}")
        answers = {
            str(question): _number(path, number, question, answer)
            for question, answer in row.items()
            if question not in _KEYS
        }
        for question, answer in answers.items():
            _require_on_scale(path, number, question, answer, plan)
        ratings[key] = {"participant": participant, "block": block, "robot": robots[key], **answers}
    return list(ratings.values())


def questions(ratings: Sequence[Mapping[str, Any]]) -> list[str]:
    """The questions, in the order of the file."""
    return list(dict.fromkeys(key for row in ratings for key in row if key not in (*_KEYS, "robot")))


def _require_on_scale(path: Path, row: int, question: str, answer: float | None, plan: StudyPlan) -> None:
    """Refuses a question that a questionnaire of the plan does not have, and an answer beyond its scale."""
    for form in plan.questionnaires:
        if question.partition(".")[0] != form.name:
            continue
        questions = [form.key(item.name) for item in form.items]
        if question not in questions:
            raise FileFormatError(path, f"questions of {form.name}: {', '.join(questions)}", question)
        low, high = form.scale.low, form.scale.high
        if answer is not None and not low <= answer <= high:
            raise FileFormatError(path, f"{low:g} to {high:g} for {question!r} in row {row}", f"{answer:g}")


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
