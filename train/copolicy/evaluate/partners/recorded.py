"""Recorded episodes as partners: the human's actions from the recorded starts, without feedback."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.agents import RecordedAgent
from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.pair_dataset import load_dataset
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import PairTask, World

_SAME_START = 1e-3  # of a recorded state; the scenario's start is then the recorded one up to rounding


@dataclass(frozen=True)
class RecordedStarts:
    """Starts and joint actions of recorded episodes.

    Attributes:
        scenarios: of the episodes.
        states: `(k,)` recorded state of each start.
        actions: `(T, 2 m)` joint actions of each episode at the rate of the task.
        origin: name of the folder, and number of its episodes.
        sources: values of the column `source`, such as human.
    """

    scenarios: tuple[Any, ...]
    states: tuple[Array, ...]
    actions: tuple[Array, ...]
    origin: str
    sources: tuple[str, ...]

    def agent(self, repeats: int = 1) -> RecordedAgent:
        """Its players, at either seat of these starts, each repeated."""
        return RecordedAgent([actions for actions in self.actions for _ in range(repeats)], "replay")

    def worlds(self, task: PairTask, settings: Any, repeats: int = 1) -> list[World]:
        """A world at each recorded start."""
        made = []
        for scenario, state in zip(self.scenarios, self.states, strict=True):
            for _ in range(repeats):
                world = task.make_world(scenario, settings)
                if np.abs(np.array(world.recorded) - state).max() > _SAME_START:
                    world.restore(tuple(state.tolist()))
                made.append(world)
        return made

    def describe(self) -> dict[str, Any]:
        """The description in results."""
        return {"recordings": self.origin, "starts": len(self.scenarios), "source": list(self.sources)}

    @property
    def sha256(self) -> str:
        """sha256 of the starts and actions."""
        parts = [scenario.digest.encode() for scenario in self.scenarios]
        parts += [values.tobytes() for values in (*self.states, *self.actions)]
        return hashlib.sha256(b"".join(parts)).hexdigest()


def read_recorded_starts(folder: Path | str, task: PairTask, settings: Any, count: int) -> RecordedStarts:
    """Reads successful episodes, spread evenly over a folder of recordings or a data set.

    A data set holds each action for a frame, so that the repeated motion can differ from the recorded one.

    Args:
        folder: with `*.mcap` recordings (also in sub-folders), or a LeRobot v3 data set, as `copolicy-convert
            upstream` writes it from the original program's files.
        settings: world settings of the study; episodes of other settings are refused.
        count: largest number of episodes.

    Raises:
        FileFormatError: no recording or data set, or none of this task with a success.
        InvalidValueError: recorded under other world settings.
    """
    folder = Path(folder)
    episodes = [episode for episode in _episodes(folder, task) if episode.usable]
    if not episodes:
        raise FileFormatError(folder, f"successful episodes of the task {task.spec.name!r}", "none")
    picked = np.unique(np.linspace(0, len(episodes) - 1, min(count, len(episodes))).round().astype(int))
    chosen = [episodes[index] for index in picked]
    for episode in chosen:
        if episode.settings is not None and replace(episode.settings, step_limit=settings.step_limit) != settings:
            found = task.settings_summary(replace(episode.settings, step_limit=task.settings_type().step_limit))
            raise InvalidValueError(f"replay {folder}", "recordings under the study's world settings", found)
    return RecordedStarts(
        tuple(episode.scenario for episode in chosen),
        tuple(episode.start for episode in chosen),
        tuple(episode.actions for episode in chosen),
        f"{folder.name}: {len(episodes)} successful episodes",
        tuple(sorted({episode.source for episode in chosen})),
    )


@dataclass(frozen=True)
class _Recorded:
    scenario: Any
    start: Array
    actions: Array
    settings: Any
    source: str
    usable: bool


def _episodes(folder: Path, task: PairTask) -> Iterator[_Recorded]:
    if not folder.is_dir():
        raise FileFormatError(folder, "a folder of recordings or a data set", "no such folder")
    if (folder / "meta").is_dir():
        data = load_dataset(folder)
        if data.task is not task:
            raise FileFormatError(folder, f"a data set of the task {task.spec.name!r}", data.task.spec.name)
        hold = stride(data.fps, task.spec.record_hz)
        for episode in data.episodes:
            columns = episode.columns
            start = task.recorded_of(np.asarray(episode.states[:1], float))[0]
            actions = np.repeat(np.asarray(episode.actions, float), hold, axis=0)
            usable = bool(columns["success"]) and not columns["discarded"]
            yield _Recorded(episode.scenario, start, actions, episode.settings, columns["source"], usable)
        return
    for path in visible_files(folder, "*.mcap"):
        episode = read_episode(path)
        if episode.task != task.spec.name:
            raise FileFormatError(path, f"a recording of the task {task.spec.name!r}", f"one of {episode.task!r}")
        start = task.recorded_of(np.asarray(episode.states[:1], float))[0]
        usable = episode.meta.success and not episode.meta.discarded
        yield _Recorded(episode.scenario, start, episode.actions, episode.settings, episode.meta.source, usable)
