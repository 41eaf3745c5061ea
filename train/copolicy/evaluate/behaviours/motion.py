"""The episodes of one method at a common rate, with what the detectors of behaviours need of them."""

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from copolicy.dataset import clock
from copolicy.dataset.arrays import Array
from copolicy.dataset.statistics.trajectories import EpisodeRow
from copolicy.dataset.statistics.trajectories import Trajectories as Frames
from copolicy.dataset.task import PairTask

from ..trajectories import Trajectory


class Event(NamedTuple):
    """One instance of a behaviour.

    Attributes:
        episode: index of the episode.
        first: frame in the episode at which it begins.
        end: frame after its last one.
        score: how clear it is; comparable within a behaviour.
        details: further entries for results.
    """

    episode: int
    first: int
    end: int
    score: float
    details: dict[str, str]


LARGEST_RATE = 10
"""Largest common rate, frames per second: leadership and preferences are defined over tenths of a second."""


def common_rate(rates: Iterable[int], largest: int = LARGEST_RATE) -> int:
    """The largest rate up to `largest` that divides all `rates`, frames per second."""
    distinct = set(rates)
    return next(rate for rate in range(largest, 0, -1) if all(each % rate == 0 for each in distinct))


def least_frames(seconds: float, fps: float) -> int:
    """Smallest number of frames, at least 1, that last at least so long."""
    return max(1, math.ceil(seconds * fps - 1e-9))  # 0.3 s at 10 Hz is 3 frames, in spite of rounding


class Motion:
    """Episodes of one method.

    Attributes:
        frames: states and mean actions at the common rate.
        trajectories: the episodes at their own rate.
    """

    def __init__(self, task: PairTask, trajectories: Sequence[Trajectory], fps: int):
        """
        Args:
            fps: common rate, which divides that of each episode.

        Raises:
            InvalidValueError: it does not.
        """
        self.trajectories = trajectories
        episodes, rows = [], []
        for each in trajectories:
            states = clock.frame_states(each.states, fps, each.fps)
            episodes.append((states.astype(float), clock.frame_actions(each.actions, fps, record_hz=each.fps)))
            columns = each.columns
            rows.append(
                EpisodeRow(
                    str(columns.get("episode_uuid", "")),
                    str(columns.get("pair_id", "")),
                    str(columns.get("map_id", "")),
                    str(columns.get("source", "simulated")),
                    bool(columns["success"]),
                    len(each.states) / each.fps,
                    each.scenario,
                )
            )
        self.frames = Frames.from_episodes(episodes, rows, fps, task)

    @property
    def task(self) -> PairTask:
        """Task of the episodes."""
        return self.frames.task

    @property
    def minutes(self) -> Array:
        """`(E,)` length of each episode."""
        return self.frames.lengths / self.frames.fps / 60

    @cached_property
    def strategy_actions(self) -> list[tuple[tuple[str, ...], Array]]:
        """Of each episode, see `Studies.strategy_actions`; no strategies where the task defines none."""
        data, found = self.frames, []
        for row, start, end in zip(data.rows, data.starts, data.ends, strict=True):
            actions = self.task.studies.strategy_actions(row.scenario, data.states[start:end])
            found.append(((), np.empty((end - start, 2, 0, 0))) if actions is None else actions)
        return found

    def joint_actions(self, order: Array | None) -> Array:
        """`(N, 2 m)` joint actions.

        Args:
            order: `(N,)` frame indices by which the human's actions are reordered, for a null distribution.
        """
        actions = self.frames.actions
        if order is None:
            return actions
        half = actions.shape[1] // 2
        return np.column_stack((actions[:, :half], actions[order, half:]))

    def runs(self, flags: Array, shortest_s: float) -> list[tuple[int, int, int]]:
        """Episode, first frame and end of each run of true flags `(N,)` that lasts at least `shortest_s`."""
        data, found = self.frames, []
        shortest = least_frames(shortest_s, data.fps)
        for index, (start, end) in enumerate(zip(data.starts.tolist(), data.ends.tolist(), strict=True)):
            edges = np.flatnonzero(np.diff(flags[start:end].astype(np.int8), prepend=0, append=0)).tolist()
            found += [
                (index, first, last)
                for first, last in zip(edges[::2], edges[1::2], strict=True)
                if last - first >= shortest
            ]
        return found
