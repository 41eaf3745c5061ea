"""The episodes of a LeRobot v3 data set, one after the other, for the exporters."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.clock import stride
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, features_of
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.settings_text import count_settings, parse_settings_text
from copolicy.dataset.task import PairTask


@dataclass(frozen=True, repr=False)
class ExportEpisode:
    """One episode as the data set has it: `actions[t]` was taken in `states[t]`.

    Attributes:
        index: its `episode_index`.
        states: `(T, n)` float32.
        environment: `(k,)` float32, the vector of the scenario.
        human_actions: `(T, m / 2)` float32, of the frame before.
        actions: `(T, m)` float32.
        rewards: `(T,)` float32.
        meta: its episode columns.
        fps: frames a second.
        physics: what led from state to state; the default where the data set does not say.
        task: that it is of.
    """

    index: int
    states: np.ndarray
    environment: np.ndarray
    human_actions: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    meta: dict[str, Any]
    fps: int
    physics: Any
    task: PairTask

    def __len__(self) -> int:
        return len(self.actions)

    def final_state(self) -> np.ndarray:
        """`(n,)` float32, the state that the last action led to.

        The data set ends with the last action, so that it is integrated from the last state over the steps that
        `duration_s` leaves for the last frame, under the episode's own physics.
        """
        record_hz = self.task.spec.record_hz
        step, seconds = stride(self.fps, record_hz), self.meta["duration_s"]
        steps = round(seconds * record_hz) - step * (len(self) - 1) if math.isfinite(seconds) else step
        held = np.repeat(self.actions[-1:].astype(float), min(max(steps, 1), step), axis=0)
        scenario = self.task.scenario_of_vector(self.environment, self.meta)
        return self.task.integrate(scenario, self.physics, self.states[-1], held)[-1].astype(np.float32)

    def next_states(self) -> np.ndarray:
        """`(T, n)` float32, the state of the following frame."""
        return np.vstack((self.states[1:], self.final_state()))


@dataclass(frozen=True)
class ExportSource:
    """A data set to export.

    Attributes:
        hold: how a frame's action was made of its steps.
        splits: ranges of `episode_index` by name.
        rows: one dict an exported episode: `episode_index`, `length` and the episode columns.
        left_out: discarded episodes that are not exported.
        task: that the episodes are of.
    """

    root: Path
    fps: int
    hold: str
    splits: dict[str, range]
    rows: tuple[dict[str, Any], ...]
    left_out: int
    _folder: LeRobotFolder = field(repr=False)

    @classmethod
    def open(cls, root: Path, keep_discarded: bool = False) -> "ExportSource":
        """Reads the metadata of a data set.

        Args:
            keep_discarded: export, too, what its operator discarded or `copolicy-dataset exclude` flagged.

        Raises:
            FileFormatError: no LeRobot v3 data set.
            RunError: no episode is left.
        """
        folder = LeRobotFolder.open(root)
        task, info = folder.task, folder.info
        folder.require_task(tuple(features_of(task.spec)))
        record_hz = task.spec.record_hz
        fps, hold = info["fps"], str(info["features"][ACTION].get("hold", "unknown"))
        if fps != int(fps):
            raise FileFormatError(root / INFO_FILE, f"a rate that divides {record_hz}", str(fps))
        fps = int(fps)
        splits = folder.splits
        stride(fps, record_hz)
        rows = folder.rows()
        for row in rows:
            try:
                parse_settings_text(row["physics"], task)
            except InvalidValueError as error:
                raise FileFormatError(root, f"the settings of episode {row['episode_index']}", str(error)) from None
        kept = tuple(row for row in rows if keep_discarded or not row["discarded"])
        if not kept:
            raise RunError(f"{root}: expected an episode to export, found {len(rows)}, all discarded")
        return cls(root, fps, hold, splits, kept, len(rows) - len(kept), folder)

    @property
    def frames(self) -> int:
        """Frames of the exported episodes."""
        return sum(row["length"] for row in self.rows)

    def facts(self) -> dict[str, Any]:
        """What every exported file says of where it comes from."""
        sources = Counter(row["source"] for row in self.rows)
        licenses = sorted({row["license"] for row in self.rows} - {""})
        return {
            "format_of_origin": f"LeRobot v3, copolicy {self.task.spec.title}",
            "fps": self.fps,
            "hold": self.hold,
            "sources": dict(sorted(sources.items())),
            "simulated": bool(sources["simulated"]),
            "licenses": licenses,
            "physics": count_settings((row["physics"] for row in self.rows), self.task),
        }

    @property
    def environment(self) -> tuple[str, dict[str, Any]]:
        """Id of the environment, and what it must be told to go on as the episodes did, beside its defaults.

        A setting in which the episodes differ keeps its default; `facts` says which physics they have.
        """
        default: Any = self.task.settings_type()
        settings = [parse_settings_text(row["physics"], self.task) or default for row in self.rows]
        others = {}
        for setting in fields(default):
            values = {getattr(physics, setting.name) for physics in settings}
            if len(values) == 1 and values != {getattr(default, setting.name)}:
                others[setting.name] = values.pop()
        gym_id, kwargs = self.task.environment(others)
        return gym_id, {"fps": self.fps, **kwargs}

    def episodes(self) -> Iterator[ExportEpisode]:
        """The exported episodes in order; one data file is in memory at a time.

        Raises:
            FileFormatError: the frames are not those that the metadata tells of.
        """
        wanted = {row["episode_index"]: row for row in self.rows}
        names = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION, "next.reward")
        features = features_of(self.task.spec)
        for index, part in self._folder.frames({name: features[name]["shape"] for name in names}):
            if index in wanted:
                row = wanted[index]
                physics = parse_settings_text(row["physics"], self.task) or self.task.settings_type()
                yield ExportEpisode(
                    index, part[STATE], part[ENVIRONMENT_STATE][0], part[HUMAN_ACTION], part[ACTION],
                    part["next.reward"], {name: row[name] for name in EPISODE_COLUMNS}, self.fps, physics, self.task,
                )  # fmt: skip

    @property
    def task(self) -> PairTask:
        """The task of the data set."""
        return self._folder.task
