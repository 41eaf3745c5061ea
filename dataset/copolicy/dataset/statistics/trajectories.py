"""The episodes of a data set as flat arrays, the form that all statistics start from."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..exceptions import RunError, ShapeError
from ..task import PairTask, get_task


@dataclass(frozen=True)
class EpisodeRow:
    """What the statistics need to know of an episode beside its frames."""

    episode_uuid: str
    pair_id: str
    map_id: str
    source: str
    success: bool
    duration_s: float
    scenario: Any
    route_class: str = ""
    split: str = ""


@dataclass(frozen=True)
class Trajectories:
    """Episodes one after the other.

    Attributes:
        states: `(N, n)` of all frames, by `TaskSpec.state`.
        actions: `(N, m)`, by `TaskSpec.joint_action`.
        lengths: `(E,)` frames of each episode.
        fps: frames a second.
        task: that the episodes are of.
    """

    states: np.ndarray
    actions: np.ndarray
    lengths: np.ndarray
    rows: tuple[EpisodeRow, ...]
    fps: int
    task: PairTask = field(default_factory=get_task)

    def __post_init__(self):
        frames, spec = int(self.lengths.sum()), self.task.spec
        for name, array, shape in (
            ("Trajectories.states", self.states, (frames, len(spec.state))),
            ("Trajectories.actions", self.actions, (frames, len(spec.joint_action))),
            ("Trajectories.lengths", self.lengths, (len(self.rows),)),
        ):
            if array.shape != shape:
                raise ShapeError(name, shape, array.shape)

    @classmethod
    def from_episodes(
        cls,
        episodes: Sequence[tuple[np.ndarray, np.ndarray]],
        rows: Sequence[EpisodeRow],
        fps: int,
        task: PairTask | None = None,
    ) -> "Trajectories":
        """From the states `(T, n)` and actions `(T, m)` of each episode of a task, the table by default."""
        return cls(
            np.concatenate([states for states, _ in episodes]),
            np.concatenate([actions for _, actions in episodes]),
            np.array([len(states) for states, _ in episodes]),
            tuple(rows),
            fps,
            task or get_task(),
        )

    @cached_property
    def ends(self) -> np.ndarray:
        """`(E,)` one past the last frame of each episode."""
        return np.cumsum(self.lengths)

    @cached_property
    def starts(self) -> np.ndarray:
        """`(E,)` first frame of each episode."""
        return self.ends - self.lengths

    @cached_property
    def episode(self) -> np.ndarray:
        """`(N,)` episode of each frame."""
        return np.repeat(np.arange(len(self.rows)), self.lengths)

    @cached_property
    def interaction(self) -> np.ndarray:
        """`(N,)` the task's interaction measure; of the table in units of a player's full force, positive pulls apart.

        Raises:
            RunError: the task has none.
        """
        measured = self.task.interaction(self.states, self.actions)
        if measured is None:
            raise RunError(self.task.missing("interaction measure"))
        return measured

    @property
    def axes(self) -> str:
        """How many axes of an action are taken together, after a comma; empty for one."""
        count = len(self.task.spec.action)
        return {1: "", 2: ", both axes"}.get(count, f", all {count} axes")

    def player_force(self, player: int) -> np.ndarray:
        """`(N, m)` a player's action in units of its full force."""
        return np.split(self.task.spec.full_forces(self.actions), 2, axis=1)[player].copy()

    @property
    def velocity(self) -> np.ndarray:
        """`(N, k)` of what moves; k is 0 where the task does not say it."""
        return self.states[:, list(self.task.statistics.velocity)]

    @cached_property
    def labels(self) -> list[str | None]:
        """The strategy label of each episode, recomputed from its frames; None without success or label."""
        spans = zip(self.rows, self.starts.tolist(), self.ends.tolist(), strict=True)
        return [
            (row.success and self.task.strategy(row.scenario, self.states[start:end])) or None
            for row, start, end in spans
        ]

    @cached_property
    def pairs(self) -> np.ndarray:
        """`(E,)` number of each episode's pair; episodes without a pair's name count as one more pair."""
        return np.unique([row.pair_id for row in self.rows], return_inverse=True)[1]

    @cached_property
    def configurations(self) -> np.ndarray:
        """`(E,)` name of each episode's configuration: its map, and the obstacles where a name stands for several."""
        names = [row.map_id or f"map-{row.scenario.digest}" for row in self.rows]
        layouts = [self.task.layout(row.scenario) for row in self.rows]
        first: dict[str, Any] = {}
        for name, layout in zip(names, layouts, strict=True):
            first.setdefault(name, layout)
        return np.array(
            [
                name if first[name] == layout else f"{name}-{row.scenario.digest}"
                for name, layout, row in zip(names, layouts, self.rows, strict=True)
            ]
        )

    @cached_property
    def strata(self) -> np.ndarray:
        """`(E,)` number of each episode's configuration."""
        return np.unique(self.configurations, return_inverse=True)[1]

    def groups(self, with_goal: bool) -> list[np.ndarray]:
        """Episodes that share a layout, and with `with_goal` the goal: the indices of each group."""
        members: dict[Any, list[int]] = {}
        for index, row in enumerate(self.rows):
            members.setdefault(self.task.layout(row.scenario, with_goal), []).append(index)
        return [np.array(group) for _, group in sorted(members.items())]

    def path(self, index: int) -> np.ndarray:
        """`(T, 2)` the point that the task tracks in an episode; of the table its centre, px."""
        path = self.task.path(self.states[self.starts[index] : self.ends[index]])
        if path is None:
            raise RunError(self.task.missing("tracked point"))
        return path

    @cached_property
    def points(self) -> np.ndarray:
        """`(N, 2)` the tracked point in all frames."""
        return np.concatenate([self.path(index) for index in range(len(self.rows))])

    @property
    def positions_missing(self) -> str:
        """Why there are no statistics of places: the sentence for the part that the task lacks; empty where none."""
        if not self.task.offers("path"):
            return self.task.missing("tracked point")
        return "" if self.task.outline else self.task.missing("outline")

    def per_episode(self, values: np.ndarray) -> np.ndarray:
        """Sum of a value of the frames `(N,)` over each episode, `(E,)`."""
        return np.add.reduceat(values.astype(float), self.starts)
