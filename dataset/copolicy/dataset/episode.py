"""One recorded episode: what happened, on which map, and who did it with whom."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

from .exceptions import InvalidValueError, ShapeError

Source = Literal["human", "simulated", "upstream"]
TerminationReason = Literal[
    "goal", "collision_obstacle", "collision_wall", "timeout", "operator_discard", "device_lost", "focus_lost",
    "crash_recovered", "unknown",
]  # fmt: skip


@dataclass(frozen=True)
class EpisodeMeta:
    """Who, what and how of an episode; its fields are the episode columns of a data set, by exactly these names.

    Identifiers of people are pseudonyms. An empty text means that nothing is known or that nothing applies.
    """

    episode_uuid: str
    session_id: str = ""
    pair_id: str = ""
    player_0_id: str = ""
    player_1_id: str = ""
    controller_0: str = ""
    controller_1: str = ""
    map_id: str = ""
    map_set: str = ""
    seed: int = -1
    source: Source = "simulated"
    success: bool = False
    termination_reason: TerminationReason = "unknown"
    duration_s: float = 0.0
    achieved_hz: float = float("nan")
    late_ticks: int = 0
    replay_drift_px: float = float("nan")
    route_class: str = ""
    quality_flags: str = ""  # comma separated
    discarded: bool = False
    consent_id: str = ""
    license: str = ""
    software_version: str = ""
    source_sha256: str = ""
    physics: str = ""  # see physics_text
    obstacle_size: int = 0  # px, 0 where it is not known

    def __post_init__(self):
        for column in fields(self):
            kind = {"str": str, "int": int, "float": float, "bool": bool}.get(str(_type_name(column)), str)
            value = getattr(self, column.name)
            if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
                raise InvalidValueError(f"EpisodeMeta.{column.name}", kind.__name__, value)


def _type_name(column) -> str:
    return column.type.__name__ if isinstance(column.type, type) else "str"


EPISODE_COLUMNS: dict[str, str] = {column.name: _type_name(column) for column in fields(EpisodeMeta)}
"""Name and type (`str`, `int`, `float`, `bool`) of every episode column, in order."""

LATER_COLUMNS: tuple[str, ...] = ("physics", "obstacle_size")
"""Episode columns that data sets of earlier versions lack; readers take the default of `EpisodeMeta` for them."""

UNKNOWN_VALUES: dict[str, Any] = {
    column.name: column.default
    if column.name in LATER_COLUMNS
    else {"str": "", "int": -1, "float": float("nan"), "bool": False}[_type_name(column)]
    for column in fields(EpisodeMeta)
}
"""What stands for an empty entry of each episode column."""


@dataclass(frozen=True, repr=False)
class Episode:
    """States and actions at 30 Hz: `actions[k]` was taken in `states[k]`.

    Attributes:
        states: `(T, 7)` x, y, cos_theta, sin_theta, vx, vy, omega (px, px/s, rad/s).
        actions: `(T, 4)` robot xy, human xy in [-1, 1].
        final_state: `(7,)` the state that the last action led to.
        fps: states a second; 30, except for data that was stored at another rate.
        physics: the dynamics that led from state to state.
    """

    states: np.ndarray
    actions: np.ndarray
    final_state: np.ndarray
    meta: EpisodeMeta
    map_config: MapConfig
    fps: int = 30
    physics: Physics = field(default_factory=Physics)
    notes: tuple[str, ...] = field(default=())  # what an importer noticed and wants said

    def __post_init__(self):
        steps = len(self.actions)
        for name, array, shape in (
            ("states", self.states, (steps, 7)),
            ("actions", self.actions, (steps, 4)),
            ("final_state", self.final_state, (7,)),
        ):
            if array.shape != shape:
                raise ShapeError(f"Episode.{name}", shape, array.shape)

    def __repr__(self) -> str:
        return (
            f"Episode({self.meta.episode_uuid}, states={self.states.shape}, actions={self.actions.shape}, "
            f"map={self.meta.map_id}, source={self.meta.source}, {self.meta.termination_reason})"
        )

    @property
    def path(self) -> np.ndarray:
        """`(T + 1, 2)` the table's centre from the start to the end, px."""
        return np.vstack((self.states[:, :2], self.final_state[:2]))
