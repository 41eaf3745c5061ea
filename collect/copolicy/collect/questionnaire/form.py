"""A questionnaire as data: items, their scale, and scores over items; read from JSON."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NotRequired, TypedDict

from copolicy.dataset.exceptions import FileFormatError, UnknownNameError
from copolicy.dataset.files.json_file import parse_json, read_json

FORMS = ("nasa-tlx", "fluency")
"""Questionnaires that come with the package, as files beside this module."""

_EXPECTED = "a questionnaire"
_NAME = re.compile(r"[a-z][a-z0-9_-]{0,39}")
_MOST_MARKS = 101
_LONGEST = {"text": 240, "instruction": 300, "title": 60, "label": 40}
"""Characters that the window shows in a legible size, by what they are."""


class _Scale(TypedDict):
    low: float
    high: float
    step: float
    labels: list[str]


class _Item(TypedDict):
    name: str
    text: str
    title: NotRequired[str]
    labels: NotRequired[list[str]]
    reversed: NotRequired[bool]


class _Score(TypedDict):
    name: str
    title: str
    items: list[str]


class _Form(TypedDict):
    name: str
    title: str
    instruction: str
    source: str
    scale: _Scale
    items: list[_Item]
    scores: NotRequired[list[_Score]]


@dataclass(frozen=True)
class Scale:
    """Equally spaced marks from `low` to `high`, `step` apart."""

    low: float
    high: float
    step: float

    @property
    def marks(self) -> int:
        """Number of marks."""
        return round((self.high - self.low) / self.step) + 1

    def value(self, mark: int) -> float:
        """The value of a mark, counted from 0."""
        return self.low + mark * self.step

    def mark(self, value: float) -> int | None:
        """The mark of a value; None if there is none."""
        mark = round((value - self.low) / self.step)
        return mark if 0 <= mark < self.marks and math.isclose(self.value(mark), value, abs_tol=1e-9) else None


@dataclass(frozen=True)
class Item:
    """One question.

    Attributes:
        name: key in files.
        title: short heading; may be empty.
        text: the question or statement.
        labels: of the low and the high end of the scale.
        reversed: a high answer lowers the scores.
    """

    name: str
    title: str
    text: str
    labels: tuple[str, str]
    reversed: bool = False


@dataclass(frozen=True)
class Score:
    """The mean over some items, after reversed ones are mirrored at the middle of the scale."""

    name: str
    title: str
    items: tuple[str, ...]


@dataclass(frozen=True)
class Questionnaire:
    """A questionnaire with one scale.

    Attributes:
        name: key in files.
        instruction: for the person.
        source: publication, and where the wording is from.
        scores: over items that were all answered.
    """

    name: str
    title: str
    instruction: str
    source: str
    scale: Scale
    items: tuple[Item, ...]
    scores: tuple[Score, ...] = ()

    @classmethod
    def from_json(cls, text: str | bytes, path: Path | str) -> "Questionnaire":
        """Reads the text of a file.

        Raises:
            FileFormatError: the text is no questionnaire; the message names the part.
        """
        return _questionnaire(parse_json(text, _Form, _EXPECTED, path), path)

    def to_json(self) -> dict[str, Any]:
        """The content of its file."""
        return {
            "name": self.name,
            "title": self.title,
            "instruction": self.instruction,
            "source": self.source,
            "scale": {**vars(self.scale), "labels": list(self.items[0].labels)},
            "items": [
                {"name": item.name, "title": item.title, "text": item.text, "labels": list(item.labels),
                 "reversed": item.reversed}
                for item in self.items
            ],
            "scores": [{"name": score.name, "title": score.title, "items": list(score.items)} for score in self.scores],
        }  # fmt: skip

    def key(self, item: str) -> str:
        """The name of an item or a score in tables: `questionnaire.item`."""
        return f"{self.name}.{item}"

    def score(self, score: Score, answers: Mapping[str, float | None]) -> float | None:
        """The value of a score from answers by item; None if one of its items has no answer."""
        values = []
        for item in self.items:
            if item.name in score.items:
                value = answers.get(item.name)
                if value is None:
                    return None
                values.append(self.scale.low + self.scale.high - value if item.reversed else value)
        return sum(values) / len(values)


def read_questionnaire(name: str | Path) -> Questionnaire:
    """Reads one of `FORMS`, or a file.

    Raises:
        UnknownNameError: neither.
        FileFormatError: the file is no questionnaire; the message names the part.
    """
    if name in FORMS:
        path = Path(__file__).with_name(f"{str(name).replace('-', '_')}.json")
    else:
        path = Path(name)
        if not path.suffix and not path.exists():
            raise UnknownNameError("questionnaire", str(name), (*FORMS, "FILE.json"))
    return _questionnaire(read_json(path, _Form, _EXPECTED), path)


def _questionnaire(form: _Form, path: Path | str) -> Questionnaire:
    scale = Scale(*(float(form["scale"][end]) for end in ("low", "high", "step")))
    steps = (scale.high - scale.low) / (scale.step or math.nan)
    _require(path, math.isfinite(steps), "a scale of finite numbers", scale)
    _require(path, scale.step > 0 and scale.high > scale.low, "a scale with low < high and step > 0", scale)
    even = math.isclose(steps, round(steps), abs_tol=1e-9) and round(steps) < _MOST_MARKS
    _require(path, even, f"a scale of whole steps, at most {_MOST_MARKS} marks", scale)
    names = [form["name"], *(item["name"] for item in form["items"]), *(s["name"] for s in form.get("scores", []))]
    for name in names:
        _require(path, bool(_NAME.fullmatch(name)), "names of a-z, 0-9, '_' and '-' that begin with a letter", name)
    twice = next((name for name in names[1:] if names[1:].count(name) > 1), "")
    _require(path, not twice, "items and scores of different names", twice)
    _require(path, bool(form["items"]), "at least one item", "none")
    _require_length(path, "instruction", form["instruction"], "the questionnaire")
    _require_length(path, "title", form["title"], "the questionnaire")
    items = tuple(_item(path, item, form["scale"]["labels"]) for item in form["items"])
    scores = tuple(Score(score["name"], score["title"], tuple(score["items"])) for score in form.get("scores", []))
    for score in scores:
        unknown = [name for name in score.items if name not in names[1 : 1 + len(items)]]
        _require(path, bool(score.items) and not unknown, f"items of the questionnaire in score {score.name}", unknown)
    return Questionnaire(form["name"], form["title"], form["instruction"], form["source"], scale, items, scores)


def _item(path: Path | str, item: _Item, default: list[str]) -> Item:
    labels = item.get("labels", default)
    _require(path, len(labels) == 2, f"two labels for {item['name']}, of the low and the high end", labels)
    _require(path, bool(item["text"].strip()), f"a text for {item['name']}", item["text"])
    title = item.get("title", "")
    for kind, text in (("text", item["text"]), ("title", title), *(("label", label) for label in labels)):
        _require_length(path, kind, text, item["name"])
    return Item(item["name"], title, item["text"], (labels[0], labels[1]), item.get("reversed", False))


def _require_length(path: Path | str, kind: str, text: str, owner: str) -> None:
    most = _LONGEST[kind]
    _require(path, len(text) <= most, f"at most {most} characters in the {kind} of {owner}", f"{len(text)}")


def _require(path: Path | str, condition: bool, expected: str, found: Any) -> None:
    if not condition:
        raise FileFormatError(path, expected, str(found))
