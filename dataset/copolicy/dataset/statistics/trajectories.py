"""The episodes of a data set as concatenated arrays, the input of all statistics."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array
from ..exceptions import RunError, ShapeError
from ..task import PairTask, get_task


@dataclass(frozen=True)
class EpisodeRow:
    """Metadata of an episode for the statistics."""

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
    """Concatenated episodes.

    Attributes:
        states: `(N, n)` states of all frames, see `TaskSpec.state`.
        actions: `(N, 2 m)` joint actions, see `TaskSpec.joint_action`.
        lengths: `(E,)` number of frames of each episode.
        rows: metadata of each episode.
        fps: frames per second.
        task: task of the episodes.
    """

    states: Array
    actions: Array
    lengths: Array
    rows: tuple[EpisodeRow, ...]
    fps: int
    task: PairTask = field(default_factory=get_task)

    def __post_init__(self) -> None:
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
        episodes: Sequence[tuple[Array, Array]],
        rows: Sequence[EpisodeRow],
        fps: int,
        task: PairTask | None = None,
    ) -> "Trajectories":
        """From the states `(T, n)` and joint actions `(T, 2 m)` of each episode; the table task by default."""
        return cls(
            np.concatenate([states for states, _ in episodes]),
            np.concatenate([actions for _, actions in episodes]),
            np.array([len(states) for states, _ in episodes]),
            tuple(rows),
            fps,
            task or get_task(),
        )

    @cached_property
    def ends(self) -> Array:
        """`(E,)` end (exclusive) of each episode's frames."""
        return np.cumsum(self.lengths)

    @cached_property
    def starts(self) -> Array:
        """`(E,)` index of each episode's first frame."""
        return self.ends - self.lengths

    @cached_property
    def episode(self) -> Array:
        """`(N,)` episode index of each frame."""
        return np.repeat(np.arange(len(self.rows)), self.lengths)

    @cached_property
    def interaction(self) -> Array:
        """`(N,)` interaction measure; for the table task in full forces, positive if the players pull apart.

        Raises:
            RunError: the task has no interaction measure.
        """
        values = self.task.interaction(self.states, self.actions)
        if values is None:
            raise RunError(self.task.missing("interaction measure"))
        return values

    @property
    def axes(self) -> str:
        """Text for definitions: `, both axes` or `, all 3 axes`; empty for actions with one axis."""
        count = len(self.task.spec.action)
        return {1: "", 2: ", both axes"}.get(count, f", all {count} axes")

    def player_force(self, player: int) -> Array:
        """`(N, m)` a player's action in units of its full force."""
        return np.split(self.task.spec.full_forces(self.actions), 2, axis=1)[player].copy()

    @property
    def velocity(self) -> Array:
        """`(N, k)` velocity of the body; k is 0 if the task states none."""
        return self.states[:, list(self.task.statistics.velocity)]

    @cached_property
    def labels(self) -> list[str | None]:
        """Strategy label of each episode, computed from its frames; None for failures and episodes without label."""
        spans = zip(self.rows, self.starts.tolist(), self.ends.tolist(), strict=True)
        return [
            (row.success and self.task.strategy(row.scenario, self.states[start:end])) or None
            for row, start, end in spans
        ]

    @cached_property
    def pairs(self) -> Array:
        """`(E,)` pair index of each episode; episodes without a `pair_id` form one pair."""
        return np.unique([row.pair_id for row in self.rows], return_inverse=True)[1]

    @cached_property
    def configurations(self) -> Array:
        """`(E,)` configuration of each episode: the name of its map, made unique if maps of one name differ."""
        names = [row.map_id or f"map-{row.scenario.digest}" for row in self.rows]
        layouts = [self.task.layout(row.scenario) for row in self.rows]
        first_layouts: dict[str, Any] = {}
        for name, layout in zip(names, layouts, strict=True):
            first_layouts.setdefault(name, layout)
        return np.array(
            [
                name if first_layouts[name] == layout else f"{name}-{row.scenario.digest}"
                for name, layout, row in zip(names, layouts, self.rows, strict=True)
            ]
        )

    @cached_property
    def strata(self) -> Array:
        """`(E,)` configuration index of each episode."""
        return np.unique(self.configurations, return_inverse=True)[1]

    def groups(self, with_goal: bool) -> list[Array]:
        """Episode indices of each group with the same layout, and with `with_goal` the same goal."""
        members: dict[Any, list[int]] = {}
        for index, row in enumerate(self.rows):
            members.setdefault(self.task.layout(row.scenario, with_goal), []).append(index)
        return [np.array(group) for _, group in sorted(members.items())]

    def path(self, index: int) -> Array:
        """`(T, 2)` positions of the tracked point in an episode; for the table task its centre, px."""
        path = self.task.path(self.states[self.starts[index] : self.ends[index]])
        if path is None:
            raise RunError(self.task.missing("tracked point"))
        return path

    @cached_property
    def points(self) -> Array:
        """`(N, 2)` positions of the tracked point in all frames."""
        return np.concatenate([self.path(index) for index in range(len(self.rows))])

    @property
    def positions_missing(self) -> str:
        """Reason why statistics of positions are undefined (`PairTask.missing`); empty if they are defined."""
        if not self.task.offers("path"):
            return self.task.missing("tracked point")
        return "" if self.task.outline else self.task.missing("outline")

    def per_episode(self, values: Array) -> Array:
        """`(E,)` sums of frame values `(N,)` over each episode."""
        return np.add.reduceat(values.astype(float), self.starts)
