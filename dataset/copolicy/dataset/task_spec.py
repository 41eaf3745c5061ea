"""The specification of a task as plain data: vectors with names, units and bounds, seats, rate, reasons."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .arrays import Array
from .exceptions import InvalidValueError

RECORD_HZ = 30
"""Default steps of simulation and recording per second."""

PLAYERS = ("robot", "human")

TIMEOUT = "timeout"
"""Termination reason of an episode that reaches the step limit, in every task."""


@dataclass(frozen=True)
class Vector:
    """Names, units and bounds of the elements of a vector.

    Attributes:
        names: name of each element.
        units: unit of each element, `1` for none.
        low: lowest value of each element; low and high scale the input of policies.
        high: highest value of each element, above the lowest.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self) -> None:
        sizes = {name: len(getattr(self, name)) for name in ("names", "units", "low", "high")}
        if len(set(sizes.values())) != 1:
            raise InvalidValueError("Vector", "as many units, low and high values as names", sizes)
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise InvalidValueError("Vector", "low values below the high ones", (self.low, self.high))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def bounds(self) -> Array:
        """Lowest and highest values, `(2, n)`."""
        return np.array((self.low, self.high), float)

    @property
    def range(self) -> str:
        """The bounds as text: `[-1, 1]` if they are the same for all elements."""
        uniform = len(set(self.low)) == len(set(self.high)) == 1
        return f"[{self.low[0]:g}, {self.high[0]:g}]" if uniform else f"their bounds, {self.low} to {self.high}"


@dataclass(frozen=True)
class TaskSpec:
    """The specification of a task; stored in recordings, data sets and checkpoints.

    Attributes:
        name: name for `get_task`.
        sentence: LeRobot's task sentence.
        state: the state that agents and policies observe.
        recorded: the state that recordings store; `PairTask.states_of` computes `state` from it.
        scenario: the vector of a scenario in a data set.
        action: one player's action.
        reasons: termination reasons of the world.
        successes: those of `reasons` that mean success.
        record_hz: steps per second.
        players: names of the seats.
        title: name in messages; `name` by default.
    """

    name: str
    sentence: str
    state: Vector
    recorded: Vector
    scenario: Vector
    action: Vector
    reasons: tuple[str, ...]
    record_hz: int = RECORD_HZ
    players: tuple[str, str] = PLAYERS
    title: str = ""
    successes: tuple[str, ...] = ("goal",)

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", self.title or self.name)
        if not set(self.successes) <= set(self.reasons):
            raise InvalidValueError(f"TaskSpec.successes of {self.name!r}", f"some of {self.reasons}", self.successes)

    def to_dict(self) -> dict[str, Any]:
        """The specification as a JSON-compatible dictionary."""
        return asdict(self)

    @property
    def joint_action(self) -> Vector:
        """The vector of both players' actions, robot first; names are prefixed with the player's."""
        single = self.action
        names = tuple(f"{player}_{name}" for player in self.players for name in single.names)
        return Vector(names, single.units * 2, single.low * 2, single.high * 2)

    def full_forces(self, actions: Array) -> Array:
        """Joint actions `(N, 2 m)` in units of a player's full force, which is the larger absolute bound of an axis."""
        return actions / np.abs(self.joint_action.bounds).max(axis=0).astype(actions.dtype)
