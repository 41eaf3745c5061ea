"""The sources of figures and behaviours: data sets, results with trajectories, and the cells of a cross-play."""

from collections import defaultdict
from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypedDict

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.task import PairTask

from .file_names import split_name
from .stored_settings import differences
from .trajectories import SUFFIX, Trajectories, Trajectory, demonstrations, read_trajectories

SOURCE_HELP = (
    "folder of a data set (demonstrations), result with trajectories beside it, trajectories file, or folder of a "
    "cross-play, each with a name; SOURCE#ROBOT takes one robot of a study"
)
CELLS = "cells"
"""Folder of a cross-play with a file for each robot and partner."""

OF_A_CELL = ("fps", "robot", "partner", "recorded_sha256")
"""Settings of a cell; the others are of the whole cross-play."""

_EXPECTED = "a data set, a result with trajectories (--trajectories), or the folder of a cross-play with them"


class _CellSettings(TypedDict):
    settings: dict[str, Any]


@dataclass(frozen=True)
class Source:
    """Episodes of one data set or of one robot of a study.

    Attributes:
        label: says how the episodes were made, and whether people took part.
        demonstrations: whether they are from a data set.
        numbers: number of each episode: its index in the data set, or its place among those of the robot.
    """

    name: str
    label: str
    path: str
    demonstrations: bool
    episodes: Sequence[Trajectory]
    numbers: Sequence[int]

    @property
    def successes(self) -> int:
        """Number of successful episodes."""
        return sum(bool(episode.columns["success"]) for episode in self.episodes)

    @property
    def fps(self) -> list[int]:
        """Rates of the episodes, frames per second."""
        return sorted({episode.fps for episode in self.episodes})

    def of_layouts(self, task: PairTask, layouts: Collection[Hashable]) -> "Source":
        """The episodes with the obstacles and goal of one of the maps, whatever their start."""
        on_map = [
            (number, episode)
            for number, episode in zip(self.numbers, self.episodes, strict=True)
            if task.layout(episode.scenario, with_goal=True) in layouts
        ]
        numbers, episodes = zip(*on_map, strict=True) if on_map else ((), ())
        return replace(self, numbers=numbers, episodes=episodes)


def read_sources(texts: Sequence[str]) -> tuple[PairTask, list[Source]]:
    """Reads `NAME=SOURCE` texts, see `SOURCE_HELP`. A study of several robots becomes one source for each.

    Raises:
        FileFormatError: a source does not exist, has no episodes, or no trajectories.
        InvalidValueError: equal names, an unknown robot, the robot of a data set, or sources of several tasks.
    """
    sources: list[Source] = []
    task: PairTask | None = None
    for text in texts:
        name, path, robot = _parsed(text)
        is_data_set = (path / INFO_FILE).is_file()
        read = demonstrations(path) if is_data_set else _study(path)
        if not read.episodes:
            raise FileFormatError(path, "at least one episode", "none")
        if task is not None and task.spec.name != read.task.spec.name:
            raise InvalidValueError(text, f"a source of the task {task.spec.name} as before it", read.task.spec.name)
        task = read.task
        if is_data_set:
            if robot:
                raise InvalidValueError(text, "a data set without #ROBOT", robot)
            numbers = [int(episode.columns["episode_index"]) for episode in read.episodes]
            sources.append(Source(name, read.label, str(path), True, read.episodes, numbers))
        else:
            sources += _by_robot(name, path, robot, read)
    if task is None:
        raise InvalidValueError("SOURCE", "at least one NAME=SOURCE", "none")
    names = [source.name for source in sources]
    if len(set(names)) < len(names):
        raise InvalidValueError("NAME=SOURCE", "different names", names)
    return task, sources


def require_map(task: PairTask, sources: Sequence[Source], map_id: str) -> list[Source]:
    """The episodes of all sources on a map: its obstacles and goal, whatever the start.

    Raises:
        InvalidValueError: a source has no episode on it.
    """
    of_map = {
        task.layout(episode.scenario, with_goal=True)
        for source in sources
        for episode in source.episodes
        if episode.columns["map_id"] == map_id
    }
    if not of_map:
        raise InvalidValueError("--map", f"the map_id of an episode, such as {_some_maps(sources[0])}", map_id)
    on_map = [source.of_layouts(task, of_map) for source in sources]
    for source in on_map:
        if not source.episodes:
            raise InvalidValueError("--map", f"a map on which {source.name} has episodes", map_id)
    return on_map


def _some_maps(source: Source) -> str:
    return ", ".join(sorted({str(episode.columns["map_id"]) for episode in source.episodes})[:3])


def _parsed(text: str) -> tuple[str, Path, str]:
    """Name, path and robot of `[NAME=]SOURCE[#ROBOT]`; the name is that of the file if there is none."""
    name, rest = split_name(text)
    robot = ""
    if not Path(rest).exists() and "#" in rest:
        rest, _, robot = rest.rpartition("#")
    path = Path(rest)
    own_name = path.name or path.absolute().name  # of `.`, the folder's
    return name or own_name.removesuffix(SUFFIX).removesuffix(".json"), path, robot


def _study(path: Path) -> Trajectories:
    if not path.is_dir():
        if path.suffix not in (".json", ".parquet"):
            raise FileFormatError(path, _EXPECTED, "another file" if path.exists() else "no such file")
        return read_trajectories(path)
    cells = sorted((path / CELLS).glob(f"*{SUFFIX}"))
    if not cells:
        raise FileFormatError(path, _EXPECTED, "none")
    _require_one_study(cells)
    studies = [read_trajectories(cell) for cell in cells]
    for cell, study in zip(cells, studies, strict=True):
        if study.task.spec.name != studies[0].task.spec.name:
            raise FileFormatError(cell, f"episodes of the task {studies[0].task.spec.name}", study.task.spec.name)
    episodes = [episode for study in studies for episode in study.episodes]
    partners = sorted({str(episode.columns["partner"]) for episode in episodes if "partner" in episode.columns})
    named = f" with {', '.join(partners)}" if partners else ""
    label = f"cross-play in simulation{named}, no person took part in the study"
    return Trajectories(studies[0].task, label, episodes)


def _require_one_study(cells: Sequence[Path]) -> None:
    """Checks that the cells of a cross-play have one protocol; after `--overwrite` others can be left in the folder.

    Raises:
        FileFormatError: a cell has no result, or other settings than the first.
    """
    first: Mapping[str, Any] | None = None
    for cell in cells:
        result = cell.with_name(cell.name.removesuffix(SUFFIX) + ".json")
        stored = read_json(result, _CellSettings, "the result of the trajectories beside it")["settings"]
        settings = {name: value for name, value in stored.items() if name not in OF_A_CELL}
        first = settings if first is None else first
        for name, expected, found in differences(first, settings):
            raise FileFormatError(result, f"{name} {expected}, as in {cells[0].name}", str(found))


def _by_robot(name: str, path: Path, robot: str, read: Trajectories) -> list[Source]:
    groups: dict[str, list[Trajectory]] = defaultdict(list)
    for episode in read.episodes:
        groups[str(episode.columns["robot"])].append(episode)
    if robot and robot not in groups:
        raise InvalidValueError(f"{path}#{robot}", f"a robot of the study ({', '.join(groups)})", robot)
    chosen = {robot: groups[robot]} if robot else groups
    return [
        Source(
            name if len(chosen) == 1 else f"{name}: {each}",
            read.label,
            str(path),
            False,
            episodes,
            range(len(episodes)),
        )
        for each, episodes in chosen.items()
    ]
