"""Reads the episodes of a LeRobot v3 data set one by one, for the exporters."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
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
    """One stored episode; `actions[t]` was taken in `states[t]`.

    Attributes:
        index: `episode_index`.
        states: `(T, n)` float32.
        environment: `(k,)` float32, the scenario vector.
        human_actions: `(T, m / 2)` float32, of the previous frame.
        actions: `(T, m)` float32.
        rewards: `(T,)` float32.
        meta: the episode columns.
        fps: frames per second.
        settings: world settings of the episode, the default if unknown.
        task: task of the episode.
    """

    index: int
    states: Array
    environment: Array
    human_actions: Array
    actions: Array
    rewards: Array
    meta: dict[str, Any]
    fps: int
    settings: Any
    task: PairTask

    def __len__(self) -> int:
        return len(self.actions)

    def final_state(self) -> Array:
        """The state `(n,)` float32 after the last action.

        It is not stored: it is integrated from the last state, under the episode's settings, over the steps of the last
        frame, which follow from `duration_s`.
        """
        record_hz = self.task.spec.record_hz
        step, seconds = stride(self.fps, record_hz), self.meta["duration_s"]
        steps = round(seconds * record_hz) - step * (len(self) - 1) if math.isfinite(seconds) else step
        actions = np.repeat(self.actions[-1:].astype(float), min(max(steps, 1), step), axis=0)
        scenario = self.task.scenario_of_vector(self.environment, self.meta)
        return self.task.integrate(scenario, self.settings, self.states[-1], actions)[-1].astype(np.float32)

    def next_states(self) -> Array:
        """The states `(T, n)` float32 of the next frames."""
        return np.vstack((self.states[1:], self.final_state()))


@dataclass(frozen=True)
class ExportSource:
    """A data set to export.

    Attributes:
        downsampling: how the action of a frame was computed from its steps.
        splits: ranges of `episode_index` by name.
        rows: one dict per exported episode: `episode_index`, `length` and the episode columns.
        left_out: number of discarded episodes that are not exported.
    """

    root: Path
    fps: int
    downsampling: str
    splits: dict[str, range]
    rows: tuple[dict[str, Any], ...]
    left_out: int
    _folder: LeRobotFolder = field(repr=False)

    @classmethod
    def open(cls, root: Path, keep_discarded: bool = False) -> "ExportSource":
        """Reads the metadata of a data set.

        Args:
            keep_discarded: also export episodes that the operator or `copolicy-dataset exclude` flagged as discarded.

        Raises:
            FileFormatError: no LeRobot v3 data set.
            RunError: no episode remains.
        """
        folder = LeRobotFolder.open(root)
        task, info = folder.task, folder.info
        folder.require_task(tuple(features_of(task.spec)))
        record_hz = task.spec.record_hz
        fps, downsampling = info["fps"], str(info["features"][ACTION].get("hold", "unknown"))
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
        exported = tuple(row for row in rows if keep_discarded or not row["discarded"])
        if not exported:
            raise RunError(f"{root}: expected an episode to export, found {len(rows)}, all discarded")
        return cls(root, fps, downsampling, splits, exported, len(rows) - len(exported), folder)

    @property
    def frames(self) -> int:
        """Number of exported frames."""
        return sum(row["length"] for row in self.rows)

    def facts(self) -> dict[str, Any]:
        """Facts about the data set that every export stores."""
        sources = Counter(row["source"] for row in self.rows)
        licenses = sorted({row["license"] for row in self.rows} - {""})
        return {
            "format_of_origin": f"LeRobot v3, copolicy {self.task.spec.title}",
            "fps": self.fps,
            "hold": self.downsampling,
            "sources": dict(sorted(sources.items())),
            "simulated": bool(sources["simulated"]),
            "licenses": licenses,
            "physics": count_settings((row["physics"] for row in self.rows), self.task),
        }

    @property
    def environment(self) -> tuple[str, dict[str, Any]]:
        """Id of the gymnasium environment, and the arguments that reproduce the episodes' rate and settings.

        A setting that differs between episodes keeps its default; `facts` lists the settings of the episodes.
        """
        default: Any = self.task.settings_type()
        settings = [parse_settings_text(row["physics"], self.task) or default for row in self.rows]
        common = {}
        for setting in fields(default):
            values = {getattr(episode_settings, setting.name) for episode_settings in settings}
            if len(values) == 1 and values != {getattr(default, setting.name)}:
                common[setting.name] = values.pop()
        gym_id, kwargs = self.task.environment(common)
        return gym_id, {"fps": self.fps, **kwargs}

    def episodes(self) -> Iterator[ExportEpisode]:
        """The exported episodes in order; one data file is in memory at a time.

        Raises:
            FileFormatError: the frames contradict the metadata.
        """
        rows = {row["episode_index"]: row for row in self.rows}
        names = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION, "next.reward")
        features = features_of(self.task.spec)
        for index, frames in self._folder.frames({name: features[name]["shape"] for name in names}):
            if index in rows:
                row = rows[index]
                settings = parse_settings_text(row["physics"], self.task) or self.task.settings_type()
                yield ExportEpisode(
                    index, frames[STATE], frames[ENVIRONMENT_STATE][0], frames[HUMAN_ACTION], frames[ACTION],
                    frames["next.reward"], {name: row[name] for name in EPISODE_COLUMNS}, self.fps, settings, self.task,
                )  # fmt: skip

    @property
    def task(self) -> PairTask:
        """The task of the data set."""
        return self._folder.task
