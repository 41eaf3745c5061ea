"""The episodes of a data set as flat arrays, the form that all statistics start from."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from copolicy.tasks.table.map_config import MapConfig

from ..exceptions import ShapeError
from ..features import theta_of
from ..interaction import interaction_force


@dataclass(frozen=True)
class EpisodeRow:
    """What the statistics need to know of an episode beside its frames."""

    episode_uuid: str
    pair_id: str
    map_id: str
    source: str
    success: bool
    duration_s: float
    map_config: MapConfig
    route_class: str = ""
    split: str = ""


@dataclass(frozen=True)
class Trajectories:
    """Episodes one after the other.

    Attributes:
        states: `(N, 7)` x, y, cos_theta, sin_theta, vx, vy, omega (px, px/s, rad/s) of all frames.
        actions: `(N, 4)` robot xy, human xy in [-1, 1].
        lengths: `(E,)` frames of each episode.
        fps: frames a second.
    """

    states: np.ndarray
    actions: np.ndarray
    lengths: np.ndarray
    rows: tuple[EpisodeRow, ...]
    fps: int

    def __post_init__(self):
        frames = int(self.lengths.sum())
        for name, array, shape in (
            ("Trajectories.states", self.states, (frames, 7)),
            ("Trajectories.actions", self.actions, (frames, 4)),
            ("Trajectories.lengths", self.lengths, (len(self.rows),)),
        ):
            if array.shape != shape:
                raise ShapeError(name, shape, array.shape)

    @classmethod
    def of(
        cls, episodes: Sequence[tuple[np.ndarray, np.ndarray]], rows: Sequence[EpisodeRow], fps: int
    ) -> "Trajectories":
        """From the states `(T, 7)` and actions `(T, 4)` of each episode."""
        return cls(
            np.concatenate([states for states, _ in episodes]),
            np.concatenate([actions for _, actions in episodes]),
            np.array([len(states) for states, _ in episodes]),
            tuple(rows),
            fps,
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
    def force(self) -> np.ndarray:
        """`(N,)` interaction force, in units of a player's full force; positive pulls apart."""
        return interaction_force(theta_of(self.states), self.actions)

    @cached_property
    def pairs(self) -> np.ndarray:
        """`(E,)` number of each episode's pair; episodes without a pair's name count as one more pair."""
        return np.unique([row.pair_id for row in self.rows], return_inverse=True)[1]

    @cached_property
    def configurations(self) -> np.ndarray:
        """`(E,)` name of each episode's configuration: its map, and the obstacles where a name stands for several."""
        names = [row.map_id or f"map-{row.map_config.digest}" for row in self.rows]
        first: dict[str, tuple] = {}
        for name, row in zip(names, self.rows, strict=True):
            first.setdefault(name, layout(row.map_config))
        return np.array(
            [
                name if first[name] == layout(row.map_config) else f"{name}-{row.map_config.digest}"
                for name, row in zip(names, self.rows, strict=True)
            ]
        )

    @cached_property
    def strata(self) -> np.ndarray:
        """`(E,)` number of each episode's configuration."""
        return np.unique(self.configurations, return_inverse=True)[1]

    def groups(self, with_goal: bool) -> list[np.ndarray]:
        """Episodes that share obstacles, and with `with_goal` the goal: the indices of each group."""
        members: dict[tuple, list[int]] = {}
        for index, row in enumerate(self.rows):
            members.setdefault((layout(row.map_config), row.map_config.goal if with_goal else ()), []).append(index)
        return [np.array(group) for _, group in sorted(members.items())]

    def path(self, index: int) -> np.ndarray:
        """`(T, 2)` the table's centre in an episode, px."""
        return self.states[self.starts[index] : self.ends[index], :2]

    def per_episode(self, values: np.ndarray) -> np.ndarray:
        """Sum of a value of the frames `(N,)` over each episode, `(E,)`."""
        return np.add.reduceat(values.astype(float), self.starts)


def layout(config: MapConfig) -> tuple[tuple[float, float, int], ...]:
    """The obstacles of a map, whatever their order: x, y, and the side where sides differ within the map, else 0."""
    sizes = config.obstacle_sizes or (0,) * len(config.obstacles)
    return tuple(sorted((x, y, size) for (x, y), size in zip(config.obstacles, sizes, strict=True)))
