"""One recorded episode: states, actions, scenario and metadata."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from .arrays import Array
from .exceptions import InvalidValueError, ShapeError
from .task import get_task
from .task_spec import TaskSpec

Source = Literal["human", "simulated", "upstream"]

GENERIC_REASONS = ("operator_discard", "device_lost", "focus_lost", "crash_recovered", "unknown")
"""Termination reasons that every task has, in addition to its own."""


def termination_reasons(spec: TaskSpec) -> tuple[str, ...]:
    """Allowed values of the episode column `termination_reason` for a task."""
    return (*spec.reasons, *GENERIC_REASONS)


@dataclass(frozen=True)
class EpisodeMeta:
    """Metadata of an episode. The field names are the episode columns of a data set.

    Identifiers of people are pseudonyms. An empty string means unknown or not applicable.
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
    quality_flags: str = ""  # comma-separated
    discarded: bool = False
    consent_id: str = ""
    license: str = ""
    software_version: str = ""
    source_sha256: str = ""
    physics: str = ""  # see settings_text
    obstacle_size: int = 0  # px, 0 if unknown; the largest if sizes differ
    obstacle_sizes: str = ""  # px of each, comma-separated, if sizes differ
    map_set_version: str = ""  # of a set from a file
    map_set_digest: str = ""
    map_weight: int = 1  # relative frequency of the map in its set

    def __post_init__(self) -> None:
        for column in fields(self):
            expected = {"str": str, "int": int, "float": float, "bool": bool}.get(str(_type_name(column)), str)
            value = getattr(self, column.name)
            if not isinstance(value, expected) or (expected is int and isinstance(value, bool)):
                raise InvalidValueError(f"EpisodeMeta.{column.name}", expected.__name__, value)


def _type_name(column) -> str:
    return column.type.__name__ if isinstance(column.type, type) else "str"


EPISODE_COLUMNS: dict[str, str] = {column.name: _type_name(column) for column in fields(EpisodeMeta)}
"""Name and type (`str`, `int`, `float`, `bool`) of every episode column, in order."""

SET_COLUMNS: tuple[str, ...] = ("map_set_version", "map_set_digest", "map_weight")
"""Episode columns of maps from a file. Recordings and content hashes leave them out if they have their defaults."""

UNHASHED_DEFAULTS: tuple[str, ...] = ("obstacle_sizes", *SET_COLUMNS)
"""Episode columns that the content hash leaves out if they have their default."""

LATER_COLUMNS: tuple[str, ...] = ("physics", "obstacle_size", *UNHASHED_DEFAULTS)
"""Episode columns that data sets of earlier versions lack; readers then use the default of `EpisodeMeta`."""

UNKNOWN_VALUES: dict[str, Any] = {
    column.name: column.default
    if column.name in LATER_COLUMNS
    else {"str": "", "int": -1, "float": float("nan"), "bool": False}[_type_name(column)]
    for column in fields(EpisodeMeta)
}
"""The value that replaces a missing entry of each episode column."""


@dataclass(frozen=True, repr=False)
class Episode:
    """One episode at the recording rate: `actions[k]` was applied in `states[k]`.

    Attributes:
        states: `(T, n)`, see `TaskSpec.state`; for the table task: x, y, cos_theta, sin_theta, vx, vy, omega.
        actions: `(T, 2 m)`, see `TaskSpec.joint_action`; for the table task: robot xy, human xy in [-1, 1].
        final_state: `(n,)` state after the last action.
        scenario: start, goal and obstacles of the episode; for the table task its `MapConfig`.
        fps: states per second: the rate of the task, unless the data were stored at another rate.
        settings: settings of the simulated world; None stands for the defaults of the task.
        notes: warnings of the importer or reader, one sentence each.
        task: name of the task.

    Raises:
        ShapeError: an array does not have the shape given by the spec of the task.
        UnknownNameError: the task is not installed.
    """

    states: Array
    actions: Array
    final_state: Array
    meta: EpisodeMeta
    scenario: Any
    fps: int = 30
    settings: Any = None
    notes: tuple[str, ...] = field(default=())
    task: str = "table"

    def __post_init__(self) -> None:
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
        """Alias of `scenario`, the name that the table task uses."""
        return self.scenario

    @property
    def physics(self) -> Any:
        """Alias of `settings`, the name that the table task uses."""
        return self.settings

    @property
    def path(self) -> Array | None:
        """`(T + 1, 2)` positions of the tracked point, from start to end; None if the task tracks none."""
        return get_task(self.task).path(np.vstack((self.states, self.final_state)))
