"""Reads the participants' ratings of each block from a CSV or JSON file."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError

from .plan import StudyPlan

_KEYS = ("participant", "block")
_EXPECTED = "ratings with the columns participant, block and one for each question"


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
