"""One recorded episode: what happened, in which scenario, and who did it with whom."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from .exceptions import InvalidValueError, ShapeError
from .task import get_task
from .task_spec import TaskSpec

Source = Literal["human", "simulated", "upstream"]

GENERIC_REASONS = ("operator_discard", "device_lost", "focus_lost", "crash_recovered", "unknown")
"""How an episode can end beside the reasons of its task."""


def termination_reasons(spec: TaskSpec) -> tuple[str, ...]:
    """What the column `termination_reason` of an episode of a task can hold."""
    return (*spec.reasons, *GENERIC_REASONS)


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
    termination_reason: str = "unknown"  # see termination_reasons
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
    physics: str = ""  # see settings_text
    obstacle_size: int = 0  # px, 0 where it is not known; of the largest where they differ
    obstacle_sizes: str = ""  # px of each, comma separated, where they differ
    map_set_version: str = ""  # of a set from a file
    map_set_digest: str = ""
    map_weight: int = 1  # how often the map comes up beside one of weight 1

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

SET_COLUMNS: tuple[str, ...] = ("map_set_version", "map_set_digest", "map_weight")
"""Episode columns of maps from a file; recordings and content hashes have them only where they say something."""

UNHASHED_DEFAULTS: tuple[str, ...] = ("obstacle_sizes", *SET_COLUMNS)
"""Episode columns that the content hash leaves out where they have their default."""

LATER_COLUMNS: tuple[str, ...] = ("physics", "obstacle_size", *UNHASHED_DEFAULTS)
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
    """States and actions at the rate of recordings: `actions[k]` was taken in `states[k]`.

    Attributes:
        states: `(T, n)`, by `TaskSpec.state`; of the table: x, y, cos_theta, sin_theta, vx, vy, omega.
        actions: `(T, m)`, by `TaskSpec.joint_action`; of the table: robot xy, human xy in [-1, 1].
        final_state: `(n,)` the state that the last action led to.
        scenario: where it began and what it was about; of the table: the map.
        fps: states a second; that of the task, except for data that was stored at another rate.
        settings: of the world that led from state to state; the task's default where None is given.
        notes: what an importer noticed and wants said.
        task: name of the task.

    Raises:
        ShapeError: an array does not fit the spec of the task.
        UnknownNameError: the task is not installed.
    """

    states: np.ndarray
    actions: np.ndarray
    final_state: np.ndarray
    meta: EpisodeMeta
    scenario: Any
    fps: int = 30
    settings: Any = None
    notes: tuple[str, ...] = field(default=())
    task: str = "table"

    def __post_init__(self):
        task = get_task(self.task)
        if self.settings is None:
            object.__setattr__(self, "settings", task.settings_type())
        steps, width = len(self.actions), len(task.spec.state)
        for name, array, shape in (
            ("states", self.states, (steps, width)),
            ("actions", self.actions, (steps, len(task.spec.joint_action))),
            ("final_state", self.final_state, (width,)),
        ):
            if array.shape != shape:
                raise ShapeError(f"Episode.{name}", shape, array.shape)

    def __repr__(self) -> str:
        return (
            f"Episode({self.meta.episode_uuid}, states={self.states.shape}, actions={self.actions.shape}, "
            f"map={self.meta.map_id}, source={self.meta.source}, {self.meta.termination_reason})"
        )

    @property
    def map_config(self) -> Any:
        """The scenario, by the table's name for it."""
        return self.scenario

    @property
    def physics(self) -> Any:
        """The settings, by the table's name for them."""
        return self.settings

    @property
    def path(self) -> np.ndarray | None:
        """`(T + 1, 2)` the point that the task tracks, from the start to the end; None where it tracks none."""
        return get_task(self.task).path(np.vstack((self.states, self.final_state)))
