"""Reads scenario files in YAML or JSON safely and validates them; every problem has its location and line."""

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
_EXPECTED = "a scenario file, YAML or JSON"
_TYPE_NAMES = {"str": "text", "int": "a whole number", "float": "a number", "bool": "true or false", "null": "nothing",
          "object": "a mapping", "array": "a list"}  # fmt: skip
_MISMATCH = re.compile(r"Expected (?P<expected>.+?)(?:, got (?P<found>.+?))?(?: - at `(?P<place>.+)`)?")


@dataclass(frozen=True)
class ScenarioProblem:
    """One problem in a scenario file.

    Attributes:
        location: path of the entry, such as `maps[2].start`; empty for the whole file.
        line: line of the entry, from 1; 0 if unknown.
    """

    location: str
    message: str
    line: int = 0

    def __str__(self) -> str:
        line = f" (line {self.line})" if self.line else ""
        return f"{self.location}{line}: {self.message}" if self.location else self.message


class Document:
    """The content of a YAML or JSON file, with the line of each entry.

    Attributes:
        content: mappings, lists, strings and numbers.
        problems: duplicate keys.
    """

    def __init__(self, path: Path):
        """
        Raises:
            FileFormatError: the file does not exist, or is neither YAML nor JSON.
        """
        self.path = path
        self.problems: list[ScenarioProblem] = []
        self._lines: dict[str, int] = {}
        if not path.is_file():
            raise FileFormatError(path, _EXPECTED, describe_path(path) if path.exists() else "no such file")
        if path.stat().st_size > _MOST_BYTES:
            raise FileFormatError(path, f"{_EXPECTED} of at most {_MOST_BYTES} bytes", f"{path.stat().st_size}")
        text = read_text(path)
        try:
            self.content = (
                json.loads(text, object_pairs_hook=_unique_keys) if path.suffix.lower() == ".json" else self._yaml(text)
            )
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            line = "" if mark is None else f" in line {mark.line + 1}"
            raise FileFormatError(path, _EXPECTED, f"{error.problem or error.context}{line}") from None
        except (ValueError, RecursionError, yaml.YAMLError) as error:
            raise FileFormatError(path, _EXPECTED, " ".join(str(error).split())) from None
        if not isinstance(self.content, dict):
            raise FileFormatError(path, f"{_EXPECTED} with a mapping at its top", _type_text(self.content))

    def problem(self, location: str, message: str) -> ScenarioProblem:
        """A problem at a location, with its line or that of the nearest known parent."""
        parent = location
        while parent and parent not in self._lines:
            parent = re.sub(r"(\.[^.\[]+|\[\d+\]|^[^.\[]+)$", "", parent)
        return ScenarioProblem(location, message, self._lines.get(parent, 0))

    def typed[T: msgspec.Struct](self, expected_type: type[T]) -> tuple[T | None, list[ScenarioProblem]]:
        """The content converted to a type, and all problems; the content is None if there are any."""
        problems = list(self.problems)
        plain = self._checked(self.content, expected_type, "", problems)
        return (None if problems else msgspec.convert(plain, expected_type)), problems

    def _yaml(self, text: str) -> Any:
        loader = _Loader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                raise ValueError("an empty file")
            self._mark(node, "")
            return loader.construct_document(node)
        finally:
            loader.dispose()

    def _mark(self, node: yaml.Node, location: str) -> None:
        self._lines[location] = node.start_mark.line + 1
        if isinstance(node, yaml.MappingNode):
            keys = set()
            for key, value in node.value:
                inner = _joined(location, str(key.value))
                if key.value in keys:
                    self.problems.append(ScenarioProblem(inner, "duplicate key", key.start_mark.line + 1))
                keys.add(key.value)
                self._mark(value, inner)
        elif isinstance(node, yaml.SequenceNode):
            for index, value in enumerate(node.value):
                self._mark(value, f"{location}[{index}]")

    def _checked(self, value: Any, expected_type: Any, location: str, problems: list[ScenarioProblem]) -> Any:
        """The value without unknown keys; appends every difference from the type to `problems`."""
        if isinstance(expected_type, type) and issubclass(expected_type, msgspec.Struct):
            if not isinstance(value, dict):
                problems.append(self.problem(location, f"expected a mapping, found {_type_text(value)}"))
                return value
            fields = {field.name: field for field in msgspec.structs.fields(expected_type)}
            for key in (key for key in value if key not in fields):
                close = difflib.get_close_matches(str(key), fields, n=1, cutoff=0.5)
                hint = f"did you mean {close[0]}?" if close else f"known are {', '.join(fields)}"
                problems.append(self.problem(_joined(location, str(key)), f"unknown key; {hint}"))
            for name, field in fields.items():
                if name not in value and field.required:
                    problems.append(self.problem(location, f"no {name}"))
            return {
                name: self._checked(value[name], field.type, _joined(location, name), problems)
                for name, field in fields.items()
                if name in value
            }
        plain = get_args(expected_type)[0] if get_origin(expected_type) is Annotated else expected_type
        if get_origin(plain) is list and isinstance(value, list):
            (item_type,) = get_args(plain)
            return [self._checked(item, item_type, f"{location}[{i}]", problems) for i, item in enumerate(value)]
        try:
            msgspec.convert(value, expected_type)
            if isinstance(value, float) and not math.isfinite(value):
                raise msgspec.ValidationError(f"Expected `float`, got `{value}`")
        except msgspec.ValidationError as error:
            match = _MISMATCH.fullmatch(str(error))
            inner = "" if match is None else (match["place"] or "$")[1:]
            message = str(error) if match is None else f"expected {_readable_types(match['expected'])}"
            actual = "" if match is None or inner else f", found {value!r}"
            problems.append(self.problem(location + inner, message + actual))
        return value


class _Loader(yaml.SafeLoader):
    """Loads plain values only: no aliases, which can expand beyond the memory, and no dates."""

    yaml_implicit_resolvers: Mapping[str, Any] = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:timestamp"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Composes a node; refuses an alias."""
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark
            raise yaml.MarkedYAMLError(problem="an alias (*name), which is not read", problem_mark=mark)
        return super().compose_node(parent, index)


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        raise ValueError(f"duplicate key {next(key for key in keys if keys.count(key) > 1)!r} in one mapping")
    return dict(pairs)


def _joined(location: str, key: str) -> str:
    return f"{location}.{key}" if location else key


def _type_text(value: Any) -> str:
    names = {dict: "object", list: "array", type(None): "null"}
    return _TYPE_NAMES.get(names.get(type(value), type(value).__name__), type(value).__name__)


def _readable_types(expected: str) -> str:
    """Replaces msgspec's names of types by plain words."""
    return re.sub(r"`([^`]+)`", lambda m: " or ".join(_TYPE_NAMES.get(t, t) for t in m[1].split(" | ")), expected)
