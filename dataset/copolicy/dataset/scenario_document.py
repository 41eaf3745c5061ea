"""YAML and JSON that people write: read safely, and held against types with every difference at its place."""

import difflib
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import msgspec
import yaml

from .exceptions import FileFormatError
from .files.file_kinds import describe_path
from .files.text_files import read_text

_MOST_BYTES = 8 * 2**20
_WHAT = "a scenario file, YAML or JSON"
_NAMES = {"str": "text", "int": "a whole number", "float": "a number", "bool": "true or false", "null": "nothing",
          "object": "a mapping", "array": "a list"}  # fmt: skip
_MISMATCH = re.compile(r"Expected (?P<expected>.+?)(?:, got (?P<found>.+?))?(?: - at `(?P<place>.+)`)?")


@dataclass(frozen=True)
class Problem:
    """Something wrong in a file.

    Attributes:
        place: where, such as `maps[2].start`; empty for the whole file.
        line: of the place, from 1; 0 where it is not known.
    """

    place: str
    message: str
    line: int = 0

    def __str__(self) -> str:
        line = f" (line {self.line})" if self.line else ""
        return f"{self.place}{line}: {self.message}" if self.place else self.message


class Document:
    """The content of a file, and on which line each part of it stands.

    Attributes:
        content: mappings, lists, texts and numbers.
        problems: keys that are there twice.
    """

    def __init__(self, path: Path):
        """
        Raises:
            FileFormatError: no such file, or one that is neither YAML nor JSON.
        """
        self.path = path
        self.problems: list[Problem] = []
        self._lines: dict[str, int] = {}
        if not path.is_file():
            raise FileFormatError(path, _WHAT, describe_path(path) if path.exists() else "no such file")
        if path.stat().st_size > _MOST_BYTES:
            raise FileFormatError(path, f"{_WHAT} of at most {_MOST_BYTES} bytes", f"{path.stat().st_size}")
        text = read_text(path)
        try:
            self.content = (
                json.loads(text, object_pairs_hook=_once) if path.suffix.lower() == ".json" else self._yaml(text)
            )
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            line = "" if mark is None else f" in line {mark.line + 1}"
            raise FileFormatError(path, _WHAT, f"{error.problem or error.context}{line}") from None
        except (ValueError, RecursionError, yaml.YAMLError) as error:
            raise FileFormatError(path, _WHAT, " ".join(str(error).split())) from None
        if not isinstance(self.content, dict):
            raise FileFormatError(path, f"{_WHAT} with a mapping at its top", _kind(self.content))

    def problem(self, place: str, message: str) -> Problem:
        """A problem at a place, with its line."""
        found = place
        while found and found not in self._lines:
            found = re.sub(r"(\.[^.\[]+|\[\d+\]|^[^.\[]+)$", "", found)
        return Problem(place, message, self._lines.get(found, 0))

    def typed[T: msgspec.Struct](self, kind: type[T]) -> tuple[T | None, list[Problem]]:
        """The content as a type, or None and everything in which it differs."""
        problems = list(self.problems)
        plain = self._held(self.content, kind, "", problems)
        return (None if problems else msgspec.convert(plain, kind)), problems

    def _yaml(self, text: str) -> Any:
        loader = _Loader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                raise ValueError("nothing in it")
            self._mark(node, "")
            return loader.construct_document(node)
        finally:
            loader.dispose()

    def _mark(self, node: yaml.Node, place: str) -> None:
        self._lines[place] = node.start_mark.line + 1
        if isinstance(node, yaml.MappingNode):
            seen = set()
            for key, value in node.value:
                inner = _joined(place, str(key.value))
                if key.value in seen:
                    self.problems.append(Problem(inner, "is there twice", key.start_mark.line + 1))
                seen.add(key.value)
                self._mark(value, inner)
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                self._mark(value, f"{place}[{index}]")

    def _held(self, value: Any, kind: Any, place: str, problems: list[Problem]) -> Any:
        """A value without the keys that its type does not know; appends what differs."""
        if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
            if not isinstance(value, dict):
                problems.append(self.problem(place, f"expected a mapping, found {_kind(value)}"))
                return value
            known = {field.name: field for field in msgspec.structs.fields(kind)}
            for key in (key for key in value if key not in known):
                close = difflib.get_close_matches(str(key), known, n=1, cutoff=0.5)
                hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(known)}"
                problems.append(self.problem(_joined(place, str(key)), f"unknown key; {hint}"))
            for name, field in known.items():
                if name not in value and field.required:
                    problems.append(self.problem(place, f"no {name}"))
            there = [name for name in known if name in value]
            return {name: self._held(value[name], known[name].type, _joined(place, name), problems) for name in there}
        plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
        if get_origin(plain) is list and isinstance(value, list):
            (item,) = get_args(plain)
            return [self._held(one, item, f"{place}[{index}]", problems) for index, one in enumerate(value)]
        try:
            msgspec.convert(value, kind)
            if isinstance(value, float) and not math.isfinite(value):
                raise msgspec.ValidationError(f"Expected `float`, got `{value}`")
        except msgspec.ValidationError as error:
            match = _MISMATCH.fullmatch(str(error))
            inner = "" if match is None else (match["place"] or "$")[1:]
            message = str(error) if match is None else f"expected {_words(match['expected'])}"
            found = "" if match is None or inner else f", found {value!r}"
            problems.append(self.problem(place + inner, message + found))
        return value


class _Loader(yaml.SafeLoader):
    """Plain values alone: no aliases, which can stand for more than memory holds, and no dates."""

    yaml_implicit_resolvers: Mapping[str, Any] = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """A node, if it is no alias."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.MarkedYAMLError(problem="an alias (*name), which is not read", problem_mark=mark)
        return super().compose_node(parent, index)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        raise ValueError(f"the key {next(key for key in keys if keys.count(key) > 1)!r} twice in one mapping")
    return dict(pairs)


def _joined(place: str, key: str) -> str:
    return f"{place}.{key}" if place else key


def _kind(value: Any) -> str:
    names = {dict: "object", list: "array", type(None): "null"}
    return _NAMES.get(names.get(type(value), type(value).__name__), type(value).__name__)


def _words(expected: str) -> str:
    """msgspec's names of types in the words of a person."""
    return re.sub(r"`([^`]+)`", lambda match: " or ".join(_NAMES.get(t, t) for t in match[1].split(" | ")), expected)
