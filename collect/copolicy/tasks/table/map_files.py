"""Map files: a lab's own maps in YAML or JSON."""

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.publication.licences import checked_licence
from copolicy.dataset.scenario_document import Document, ScenarioProblem
from copolicy.dataset.scenarios import ScenarioFiles, ScenarioName, ScenarioSet

from .map_config import MAX_OBSTACLES, MapConfig
from .maps import MAP_SETS, start_at

_SET_NAME = "[a-z][a-z0-9_-]{0,39}"
_MAP_NAME = "[a-z][a-z0-9_]{0,39}"
_DEGREES = re.compile(r"-?\d+(?:\.\d+)?deg")
_MOST_WEIGHT, _MOST_MAPS = 1000, 10_000

_X = Annotated[float, Meta(description="px, to the right; the window is 1200 wide")]
_Y = Annotated[float, Meta(description="px, down; the window is 600 high")]
_Angle = Annotated[
    float | str, Meta(description="rad, or degrees as a text such as 90deg; counter-clockwise on screen")
]


class Start(Struct, forbid_unknown_fields=True):
    """Start pose of the table's centre, at rest."""

    x: _X
    y: _Y
    theta: _Angle | None = None
    orientations: Annotated[
        list[_Angle] | None, Meta(description="instead of theta: start orientations, each of which makes a map")
    ] = None


class Goal(Struct, forbid_unknown_fields=True):
    """Centre of the goal square of 92 px."""

    x: _X
    y: _Y


class Obstacle(Struct, forbid_unknown_fields=True):
    """A solid square, by its centre."""

    x: _X
    y: _Y
    size: Annotated[int, Meta(ge=1, le=600, description="side, px")]


class Map(Struct, forbid_unknown_fields=True):
    """One map."""

    start: Start
    goal: Goal
    obstacles: Annotated[list[Obstacle], Meta(description=f"at most {MAX_OBSTACLES}")] = []
    name: Annotated[
        str, Meta(pattern=f"^(|{_MAP_NAME})$", description="for splits and recordings (default: its number, from 00)")
    ] = ""
    weight: Annotated[
        int, Meta(ge=1, le=_MOST_WEIGHT, description="number of episodes relative to a map of weight 1")
    ] = 1


class MapFile(Struct, forbid_unknown_fields=True):
    """Maps of the table-carrying task of copolicy."""

    name: Annotated[str, Meta(pattern=f"^{_SET_NAME}$", description="of the set: map_set of recordings")]
    version: Annotated[str | int | float, Meta(description="of the set; change it whenever a map changes")]
    maps: list[Map]
    task: Annotated[str, Meta(pattern="^table$")] = "table"
    author: str = ""
    license: Annotated[str, Meta(description="identifier of the Hub, such as cc-by-4.0")] = ""
    description: str = ""
    splits: Annotated[
        dict[str, list[str | int]], Meta(description="maps of each split, by name or number from 0; --maps FILE#split")
    ] = {}


class MapFiles(ScenarioFiles):
    """Reads, checks and makes map files."""

    schema: Mapping[str, Any] = msgspec.json.schema(MapFile)
    bounds: Mapping[str, tuple[float, float]] = {
        "start_x": (240, 240), "start_y": (100, 500), "start_theta": (180, 180), "goal_x": (960, 960),
        "goal_y": (150, 450), "obstacles": (1, 3), "obstacle_x": (400, 800), "obstacle_y": (50, 550),
        "obstacle_size": (50, 50),
    }  # fmt: skip

    def read(self, path: Path) -> ScenarioSet:
        """See `ScenarioFiles.read`."""
        map_set, problems = self._read(path)
        if map_set is None or problems:
            others = f" (and {len(problems) - 1} more: copolicy-collect maps check)" if len(problems) > 1 else ""
            raise FileFormatError(path, "maps that can be used", f"{problems[0]}{others}")
        return map_set

    def problems(self, path: Path) -> list[ScenarioProblem]:
        """See `ScenarioFiles.problems`."""
        return self._read(path)[1]

    def make(self, name: str, count: int, seed: int, bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        """See `ScenarioFiles.make`."""
        from .random_maps import random_maps  # scipy and pymunk

        if not re.fullmatch(_SET_NAME, name) or name in (*MAP_SETS, "custom"):
            raise InvalidValueError("--name", "lower-case letters, digits, - or _, and no set of the package", name)
        for key, minimum, maximum in (("obstacles", 0, MAX_OBSTACLES), ("obstacle_size", 1, 600)):
            low, high = bounds[key]
            if not minimum <= math.ceil(low) <= math.floor(high) <= maximum:
                expected = f"{key} with a whole number in it, from {minimum} to {maximum}"
                raise InvalidValueError("--bounds", expected, f"{key}={low:g}:{high:g}")
        maps = [_as_entry(config) for config in random_maps(count, seed, bounds)]
        text = ", ".join(f"{key}={low:g}:{high:g}" for key, (low, high) in bounds.items())
        return {
            "name": name, "version": "1", "task": "table", "description": f"{count} random maps, seed {seed}, {text}",
            "maps": maps,
        }  # fmt: skip

    def _read(self, path: Path) -> tuple[ScenarioSet | None, list[ScenarioProblem]]:
        from .map_problems import map_problems  # scipy and pymunk

        document = Document(path)
        content, problems = document.typed(MapFile)
        if content is None:
            return None, problems
        _check_texts(document, content, problems)
        maps: list[list[MapConfig]] = []
        for index, entry in enumerate(content.maps):
            maps.append(_configs(document, f"maps[{index}]", entry, f"{index:02d}", problems))
        splits = _splits(document, content, maps, problems)
        problems += [document.problem(*problem) for problem in map_problems(maps)]
        if problems:
            return None, problems
        weights = tuple(entry.weight for entry, turned in zip(content.maps, maps, strict=True) for _ in turned)
        configs = tuple(config for turned in maps for config in turned)
        map_set = ScenarioSet("table", content.name, str(content.version), configs, weights, splits, from_file=True)
        # The digest of the set is part of the names, so it is computed from the maps without full names.
        configs = tuple(_with_name(config, map_set, weight) for config, weight in zip(configs, weights, strict=True))
        return ScenarioSet(
            "table", map_set.name, map_set.version, configs, weights, splits, "", True, map_set.digest
        ), []


def _check_texts(document: Document, content: MapFile, problems: list[ScenarioProblem]) -> None:
    if content.name in (*MAP_SETS, "custom"):
        problems.append(document.problem("name", f"{content.name} is the name of a set of the package"))
    if not 1 <= len(content.maps) <= _MOST_MAPS:
        problems.append(document.problem("maps", f"expected 1 to {_MOST_MAPS} maps, found {len(content.maps)}"))
    if not 1 <= len(str(content.version)) <= 64:
        problems.append(document.problem("version", f"expected up to 64 characters, found {content.version!r}"))
    try:
        checked_licence(content.license, "license")
    except InvalidValueError as error:
        problems.append(document.problem("license", str(error).removeprefix("license: ")))
    names: dict[str, int] = {}
    for index, entry in enumerate(content.maps):
        if entry.name and names.setdefault(entry.name, index) != index:
            message = f"{entry.name} is the name of maps[{names[entry.name]}] too"
            problems.append(document.problem(f"maps[{index}].name", message))


def _configs(
    document: Document, path: str, entry: Map, number: str, problems: list[ScenarioProblem]
) -> list[MapConfig]:
    """The map in each of its orientations, named as in its file; adds what is wrong at `path` to `problems`."""
    start = entry.start
    if (start.theta is None) == (start.orientations is None):
        problems.append(document.problem(f"{path}.start", "expected either theta or orientations"))
        return []
    if len(entry.obstacles) > MAX_OBSTACLES:
        message = f"expected at most {MAX_OBSTACLES} obstacles, found {len(entry.obstacles)}"
        problems.append(document.problem(f"{path}.obstacles", message))
        return []
    angles: list[float] = []
    for angle in [start.theta] if start.orientations is None else start.orientations:
        if isinstance(angle, str) and not _DEGREES.fullmatch(angle):
            message = f"expected rad as a number, or degrees such as 90deg, found {angle!r}"
            problems.append(document.problem(f"{path}.start", message))
        else:
            if not isinstance(angle, str) and abs(angle or 0.0) > 2 * math.pi + 1e-6:
                message = f"expected rad from -2 pi to 2 pi, found {angle:g}; degrees are written {angle:g}deg"
                problems.append(document.problem(f"{path}.start", message))
            radians = math.radians(float(angle[:-3])) if isinstance(angle, str) else float(angle or 0.0)
            angles.append(radians % (2 * math.pi))
    degrees = [round(math.degrees(angle)) % 360 for angle in angles]
    if start.orientations is not None and (not angles or len(set(degrees)) < len(degrees)):
        message = "expected orientations that differ by at least a degree"
        problems.append(document.problem(f"{path}.start.orientations", message))
        return []
    name = ScenarioName(entry.name or number, "")
    obstacles = tuple((obstacle.x, obstacle.y) for obstacle in entry.obstacles)
    sizes = tuple(obstacle.size for obstacle in entry.obstacles)
    configs = [
        MapConfig((start.x, start.y, angle), (entry.goal.x, entry.goal.y), obstacles, obstacle_sizes=sizes, named=name)
        for angle in angles
    ]
    return configs if start.orientations is None else [start_at(config, config.start[2]) for config in configs]


def _splits(
    document: Document, content: MapFile, maps: list[list[MapConfig]], problems: list[ScenarioProblem]
) -> dict[str, tuple[int, ...]]:
    """Indices into the set of the maps of each split; a split has all orientations of a map."""
    first = [sum(len(turned) for turned in maps[:index]) for index in range(len(maps))]
    numbers: dict[str | int, int] = {entry.name: index for index, entry in enumerate(content.maps) if entry.name}
    splits: dict[str, tuple[int, ...]] = {}
    for name, members in content.splits.items():
        path = f"splits.{name}"
        if not re.fullmatch(_MAP_NAME, name):
            problems.append(document.problem(path, "expected lower-case letters, digits or _ as the name of a split"))
        indices = [numbers.get(member, member if isinstance(member, int) else -1) for member in members]
        for member, index in zip(members, indices, strict=True):
            if not 0 <= index < len(maps):
                problems.append(document.problem(path, f"there is no map {member!r}"))
        if not members or len(set(indices)) < len(indices):
            problems.append(document.problem(path, "expected at least one map, and each once"))
        valid = [index for index in indices if 0 <= index < len(maps)]
        splits[name] = tuple(first[index] + k for index in valid for k in range(len(maps[index])))
    return splits


def _with_name(config: MapConfig, map_set: ScenarioSet, weight: int) -> MapConfig:
    assert config.named is not None
    name = f"{map_set.name}-{config.named.scenario}"
    return replace(config, named=ScenarioName(name, map_set.name, map_set.version, map_set.digest, weight))


def _as_entry(config: MapConfig) -> dict[str, Any]:
    """A map as an entry of `MapFile.maps`."""
    x, y, theta = config.start
    return {
        "start": {"x": x, "y": y, "theta": theta},
        "goal": dict(zip("xy", config.goal, strict=True)),
        "obstacles": [{"x": x, "y": y, "size": size} for (x, y), size in config.squares],
    }
