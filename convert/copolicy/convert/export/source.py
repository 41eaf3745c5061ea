"""The episodes of a LeRobot v3 data set of this task, one after the other, for the exporters."""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.clock import stride
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, FEATURES, HUMAN_ACTION, STATE, theta_of
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.physics_text import physics_counts, physics_of
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.physics import Physics

from ..dynamics import integrate
from ..upstream.episode import states_7


@dataclass(frozen=True, repr=False)
class ExportEpisode:
    """One episode as the data set has it: `actions[t]` was taken in `states[t]`.

    Attributes:
        index: its `episode_index`.
        states: `(T, 7)` float32.
        environment: `(11,)` float32.
        human_actions: `(T, 2)` float32, of the frame before.
        actions: `(T, 4)` float32.
        rewards: `(T,)` float32.
        meta: its episode columns.
        fps: frames a second.
        physics: what led from state to state; the default where the data set does not say.
    """

    index: int
    states: np.ndarray
    environment: np.ndarray
    human_actions: np.ndarray
    actions: np.ndarray
    rewards: np.ndarray
    meta: dict[str, Any]
    fps: int
    physics: Physics

    def __len__(self) -> int:
        return len(self.actions)

    def final_state(self) -> np.ndarray:
        """`(7,)` float32, the state that the last action led to.

        The data set ends with the last action, so that it is integrated from the last state over the steps that
        `duration_s` leaves for the last frame, under the episode's own physics.
        """
        step = stride(self.fps)
        seconds = self.meta["duration_s"]
        steps = round(seconds * RECORD_HZ) - step * (len(self) - 1) if math.isfinite(seconds) else step
        x, y, _, _, vx, vy, omega = self.states[-1].astype(float).tolist()
        held = np.repeat(self.actions[-1:].astype(float), min(max(steps, 1), step), axis=0)
        after = integrate((x, y, float(theta_of(self.states[-1]))), (vx, vy, omega), held, self.physics)
        return states_7(after[-1]).astype(np.float32)

    def next_states(self) -> np.ndarray:
        """`(T, 7)` float32, the state of the following frame."""
        return np.vstack((self.states[1:], self.final_state()))


@dataclass(frozen=True)
class ExportSource:
    """A data set to export.

    Attributes:
        hold: how a frame's action was made of its steps.
        splits: ranges of `episode_index` by name.
        rows: one dict an exported episode: `episode_index`, `length` and the episode columns.
        left_out: discarded episodes that are not exported.
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
            FileFormatError: no LeRobot v3 data set of this task.
            RunError: no episode is left.
        """
        folder = LeRobotFolder.open(root)
        folder.require_task(tuple(FEATURES))
        info = folder.info
        fps, hold = info["fps"], str(info["features"][ACTION].get("hold", "unknown"))
        if fps != int(fps):
            raise FileFormatError(root / INFO_FILE, f"a rate that divides {RECORD_HZ}", str(fps))
        fps = int(fps)
        splits = folder.splits
        stride(fps)
        rows = folder.rows()
        for row in rows:
            try:
                physics_of(row["physics"])
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
            "format_of_origin": "LeRobot v3, copolicy table carrying",
            "fps": self.fps,
            "hold": self.hold,
            "sources": dict(sorted(sources.items())),
            "simulated": bool(sources["simulated"]),
            "licenses": licenses,
            "physics": physics_counts(row["physics"] for row in self.rows),
        }

    @property
    def environment(self) -> dict[str, Any]:
        """What the environment must be told to go on as the episodes did, beside its defaults.

        A setting in which the episodes differ keeps its default; `facts` says which physics they have.
        """
        default = Physics()
        settings = [physics_of(row["physics"]) or default for row in self.rows]
        kwargs: dict[str, Any] = {"fps": self.fps}
        for name in ("step_limit", "angular_acceleration_limit"):
            values = {getattr(physics, name) for physics in settings}
            if len(values) == 1 and values != {getattr(default, name)}:
                kwargs[name] = values.pop()
        return kwargs

    def episodes(self) -> Iterator[ExportEpisode]:
        """The exported episodes in order; one data file is in memory at a time.

        Raises:
            FileFormatError: the frames are not those that the metadata tells of.
        """
        wanted = {row["episode_index"]: row for row in self.rows}
        names = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION, "next.reward")
        for index, part in self._folder.frames({name: FEATURES[name]["shape"] for name in names}):
            if index in wanted:
                yield _episode(index, part, wanted[index], self.fps)


def _episode(index: int, part: dict[str, np.ndarray], row: dict[str, Any], fps: int) -> ExportEpisode:
    meta = {name: row[name] for name in EPISODE_COLUMNS}
    return ExportEpisode(
        index, part[STATE], part[ENVIRONMENT_STATE][0], part[HUMAN_ACTION], part[ACTION], part["next.reward"], meta,
        fps, physics_of(row["physics"]) or Physics(),
    )  # fmt: skip
