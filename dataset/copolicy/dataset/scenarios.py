"""Sets of scenarios: the named sets of a task, and sets from scenario files."""

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
    from .scenario_document import ScenarioProblem

SUFFIXES = (".yaml", ".yml", ".json")
"""File name suffixes of scenario files."""

DISPLACED = "-displaced"
"""Suffix of the name of a scenario whose start was displaced."""


def base_name(scenario: str) -> str:
    """The name of a scenario without the suffixes for a rotated (`-90deg`) or displaced start."""
    return re.sub(rf"(-\d+deg)?({DISPLACED})?$", "", scenario)


class ScenarioName(NamedTuple):
    """The name of a scenario, and the set that it is from.

    Attributes:
        scenario: name, such as `training-17`.
        set_name: name of the set.
        version: version of a set from a file, as the file states it; empty for a set of the task.
        digest: digest of the content of that file; empty for a set of the task.
        weight: relative frequency of the scenario in its set.
    """

    scenario: str
    set_name: str
    version: str = ""
    digest: str = ""
    weight: int = 1

    @property
    def columns(self) -> dict[str, Any]:
        """The episode columns with these values."""
        return {
            "map_id": self.scenario,
            "map_set": self.set_name,
            "map_set_version": self.version,
            "map_set_digest": self.digest,
            "map_weight": self.weight,
        }


@dataclass(frozen=True)
class ScenarioSet:
    """A named, ordered set of scenarios.

    Attributes:
        task: name of the task.
        version: version of the file; `1` for a set of the task.
        scenarios: the scenarios, each once unless a set of the task repeats it.
        weights: relative frequency of each scenario.
        splits: indices of the scenarios of each named split.
        split: name of the split that this set is; empty for the whole set.
        from_file: whether the set was read from a file.
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

    def __post_init__(self) -> None:
        if not self.digest:
            rows = [[scenario.to_json(), weight] for scenario, weight in zip(self.scenarios, self.weights, strict=True)]
            text = json.dumps([rows, {name: list(indices) for name, indices in self.splits.items()}], sort_keys=True)
            object.__setattr__(self, "digest", hashlib.sha256(text.encode()).hexdigest()[:16])

    def for_split(self, split: str) -> "ScenarioSet":
        """The scenarios of a named split, in the order of the split.

        Raises:
            UnknownNameError: the set has no such split.
        """
        if split not in self.splits:
            raise UnknownNameError(f"split of {self.name}", split, self.splits or ["none"])
        indices = self.splits[split]
        scenarios, weights = (tuple(column[index] for index in indices) for column in (self.scenarios, self.weights))
        return replace(self, scenarios=scenarios, weights=weights, splits={}, split=split)

    @property
    def label(self) -> str:
        """`NAME` or `NAME#split`."""
        return f"{self.name}#{self.split}" if self.split else self.name

    @property
    def scheduled(self) -> tuple[Any, ...]:
        """The scenarios, each repeated by its weight."""
        pairs = zip(self.scenarios, self.weights, strict=True)
        return tuple(scenario for scenario, weight in pairs for _ in range(weight))

    def describe(self) -> dict[str, str]:
        """Label, version, digest and origin (`file` or `task`), as results store them."""
        origin = "file" if self.from_file else "task"
        return {"name": self.label, "version": self.version, "digest": self.digest, "from": origin}


class ScenarioFiles(ABC):
    """The part `scenario_files` of a task, for `--maps FILE` and `copolicy-collect maps`.

    Attributes:
        schema: JSON schema of a scenario file.
        bounds: default bounds of random scenarios: lowest and highest value by name.
    """

    schema: Mapping[str, Any]
    bounds: Mapping[str, tuple[float, float]]

    @abstractmethod
    def read(self, path: Path) -> ScenarioSet:
        """Reads the set in a file.

        Raises:
            FileFormatError: the file does not exist or has a problem; the message names the first problem.
        """

    @abstractmethod
    def problems(self, path: Path) -> "list[ScenarioProblem]":
        """All problems of a file; empty if it is valid.

        Raises:
            FileFormatError: the file does not exist or cannot be parsed.
        """

    @abstractmethod
    def make(self, name: str, count: int, seed: int, bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        """The content of a valid file with random scenarios.

        Args:
            bounds: lowest and highest value for every name in `ScenarioFiles.bounds`.

        Raises:
            RunError: the bounds leave no room for so many scenarios.
        """


def set_label(row: Mapping[str, Any]) -> str:
    """The map set of an episode, with version and digest if it is from a file."""
    file = f" (version {row['map_set_version']}, {row['map_set_digest']})" if row["map_set_digest"] else ""
    return f"{row['map_set']}{file}"


def file_and_split(text: str) -> tuple[str, str]:
    """Splits `FILE#split` into path and split; the split is empty if none is given (a path may contain `#`)."""
    path, mark, split = text.rpartition("#")
    return (path, split) if mark and not Path(text).is_file() else (text, "")


def is_file_name(text: str) -> bool:
    """Whether the value of `--maps` names a file rather than a set of the task."""
    path, _ = file_and_split(text)
    return path.lower().endswith(SUFFIXES) or "/" in path or "\\" in path or Path(path).is_file()
