"""Sets of scenarios: those that come with a task, and those of a lab's own files."""

import hashlib
import json
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from .exceptions import UnknownNameError

if TYPE_CHECKING:
    from .scenario_document import Problem

SUFFIXES = (".yaml", ".yml", ".json")
"""Endings of scenario files."""

DISPLACED = "-displaced"
"""Ends the name of a scenario whose start alone was changed."""


def base_name(scenario: str) -> str:
    """The name of a scenario without what says that its start was turned (`-90deg`) or displaced."""
    return re.sub(rf"(-\d+deg)?({DISPLACED})?$", "", scenario)


class ScenarioName(NamedTuple):
    """Which scenario of which set something is.

    Attributes:
        scenario: its name, such as `training-17`.
        set_name: of its set.
        version: of a set from a file, as the file states it; empty for a set that comes with the task.
        digest: of what is in such a file; empty likewise.
        weight: how often it comes up beside a scenario of weight 1.
    """

    scenario: str
    set_name: str
    version: str = ""
    digest: str = ""
    weight: int = 1

    @property
    def columns(self) -> dict[str, Any]:
        """The episode columns that say so."""
        return {
            "map_id": self.scenario,
            "map_set": self.set_name,
            "map_set_version": self.version,
            "map_set_digest": self.digest,
            "map_weight": self.weight,
        }


@dataclass(frozen=True)
class ScenarioSet:
    """Scenarios in order, under one name.

    Attributes:
        task: name of the task that they are of.
        version: as the file states it; `1` for a set that comes with the task.
        scenarios: each once, but where a set that comes with the task repeats one.
        weights: how often each comes up beside one of weight 1.
        splits: indices of the scenarios of each named split.
        split: name of the split that this is, empty for the whole set.
        from_file: the set is not one that comes with the task.
        digest: sixteen hexadecimal digits over scenarios, weights and splits of the whole set.
    """

    task: str
    name: str
    version: str
    scenarios: tuple[Any, ...]
    weights: tuple[int, ...]
    splits: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    split: str = ""
    from_file: bool = False
    digest: str = ""

    def __post_init__(self):
        if not self.digest:
            rows = [[one.to_json(), weight] for one, weight in zip(self.scenarios, self.weights, strict=True)]
            text = json.dumps([rows, {name: list(indices) for name, indices in self.splits.items()}], sort_keys=True)
            object.__setattr__(self, "digest", hashlib.sha256(text.encode()).hexdigest()[:16])

    def part(self, split: str) -> "ScenarioSet":
        """The scenarios of a named split, in the order that the split has them.

        Raises:
            UnknownNameError: the set has no such split.
        """
        if split not in self.splits:
            raise UnknownNameError(f"split of {self.name}", split, self.splits or ["none"])
        places = self.splits[split]
        scenarios, weights = (tuple(column[place] for place in places) for column in (self.scenarios, self.weights))
        return replace(self, scenarios=scenarios, weights=weights, splits={}, split=split)

    @property
    def label(self) -> str:
        """`NAME` or `NAME#split`."""
        return f"{self.name}#{self.split}" if self.split else self.name

    @property
    def scheduled(self) -> tuple[Any, ...]:
        """The scenarios, each as often as its weight says."""
        pairs = zip(self.scenarios, self.weights, strict=True)
        return tuple(scenario for scenario, weight in pairs for _ in range(weight))

    def describe(self) -> dict[str, str]:
        """Name, version and digest, as results have them, and whether they are of a `file` or of the `task`."""
        origin = "file" if self.from_file else "task"
        return {"name": self.label, "version": self.version, "digest": self.digest, "from": origin}


class ScenarioFiles(ABC):
    """How a task writes scenarios into files: the part of a task behind `--maps FILE` and `copolicy-collect maps`.

    Attributes:
        schema: JSON schema of a file.
        bounds: within which `make` draws, lowest and highest value by name, where nothing else is asked for.
    """

    schema: Mapping[str, Any]
    bounds: Mapping[str, tuple[float, float]]

    @abstractmethod
    def read(self, path: Path) -> ScenarioSet:
        """The set in a file.

        Raises:
            FileFormatError: no such file, or one with a problem; the line names the first.
        """

    @abstractmethod
    def problems(self, path: Path) -> "list[Problem]":
        """Everything that is wrong with a file; empty where it can be used.

        Raises:
            FileFormatError: no such file, or none that can be read at all.
        """

    @abstractmethod
    def make(self, name: str, count: int, seed: int, bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        """The content of a file with scenarios drawn at random, in which `problems` finds nothing.

        Args:
            bounds: all of them, those of `ScenarioFiles.bounds` among them.

        Raises:
            RunError: they leave no room for so many.
        """


def set_label(row: Mapping[str, Any]) -> str:
    """The map set in an episode's columns, with version and digest where it is of a file."""
    file = f" (version {row['map_set_version']}, {row['map_set_digest']})" if row["map_set_digest"] else ""
    return f"{row['map_set']}{file}"


def file_and_split(text: str) -> tuple[str, str]:
    """The two parts of `FILE#split`; the split is empty where there is none (a path may hold `#`)."""
    path, mark, split = text.rpartition("#")
    return (path, split) if mark and not Path(text).is_file() else (text, "")


def is_file_name(text: str) -> bool:
    """Whether `--maps` names a file, not a set that comes with the task."""
    path, _ = file_and_split(text)
    return path.lower().endswith(SUFFIXES) or "/" in path or "\\" in path or Path(path).is_file()
