"""What a task is in plain data: its seats, its rate, and what the numbers of its vectors mean."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .exceptions import InvalidValueError

RECORD_HZ = 30
"""Steps of simulation and recording per second."""

PLAYERS = ("robot", "human")

TIMEOUT = "timeout"
"""The reason of an end by the step limit, in every task."""


@dataclass(frozen=True)
class Vector:
    """A vector of numbers with what each of them means.

    Attributes:
        names: one a number.
        units: of each, `1` for none.
        low: lowest value of each that the task knows; what scales a policy's input.
        high: highest value of each.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __post_init__(self):
        sizes = {name: len(getattr(self, name)) for name in ("names", "units", "low", "high")}
        if len(set(sizes.values())) != 1:
            raise InvalidValueError("Vector", "as many units, low and high values as names", sizes)
        if not all(low < high for low, high in zip(self.low, self.high, strict=True)):
            raise InvalidValueError("Vector", "low values below the high ones", (self.low, self.high))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest values, `(2, n)`."""
        return np.array((self.low, self.high), float)

    @property
    def range(self) -> str:
        """The bounds in words: `[-1, 1]` where all are the same."""
        one = len(set(self.low)) == len(set(self.high)) == 1
        return f"[{self.low[0]:g}, {self.high[0]:g}]" if one else f"their bounds, {self.low} to {self.high}"


@dataclass(frozen=True)
class TaskSpec:
    """What a task is, in plain data; recordings, data sets and checkpoints carry it.

    Attributes:
        name: by which `get_task` finds it.
        sentence: LeRobot's task sentence.
        state: what agents and policies see of the world.
        recorded: the state as recordings hold it; from it `PairTask.states_of` makes `state`.
        scenario: the vector of a scenario in a data set.
        action: one player's action.
        reasons: how a world can end an episode.
        successes: which of them mean success.
        record_hz: steps a second.
        players: names of the seats.
        title: what it is called in messages; its name where none is given.
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

    def __post_init__(self):
        object.__setattr__(self, "title", self.title or self.name)
        if not set(self.successes) <= set(self.reasons):
            raise InvalidValueError(f"TaskSpec.successes of {self.name!r}", f"some of {self.reasons}", self.successes)

    def to_dict(self) -> dict[str, Any]:
        """The spec as data sets and recordings carry it, JSON-able."""
        return asdict(self)

    @property
    def joint_action(self) -> Vector:
        """Both players' actions, robot first; names begin with the player's."""
        one = self.action
        names = tuple(f"{player}_{name}" for player in self.players for name in one.names)
        return Vector(names, one.units * 2, one.low * 2, one.high * 2)

    def full_forces(self, actions: np.ndarray) -> np.ndarray:
        """Joint actions `(N, 2 m)` in units of a player's full force, the farthest of the bounds of a number."""
        return actions / np.abs(self.joint_action.bounds).max(axis=0).astype(actions.dtype)
