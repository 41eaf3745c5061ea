"""What the pipeline must know of a task for two players, and which tasks are installed.

A task is one object, a `PairTask`. `get_task` finds it by its name through the entry point group `copolicy.tasks`; the
tasks that come along are registered there as those of any other package are:

    [project.entry-points."copolicy.tasks"]
    peg = "lab_peg.task:PegTask"

Player 0 is the robot seat, player 1 the human seat. A joint action is both players' actions, robot first.
"""

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from .exceptions import CopolicyError, InvalidValueError, UnknownNameError

RECORD_HZ = 30
"""Steps of simulation and recording per second."""

STATE_NAMES = ("x", "y", "cos_theta", "sin_theta", "vx", "vy", "omega")
ACTION_NAMES = ("robot_fx", "robot_fy", "human_fx", "human_fy")
PLAYERS = ("robot", "human")

ENTRY_POINTS = "copolicy.tasks"
"""The entry point group in which tasks are registered."""


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


class Scenario(Protocol):
    """Where an episode starts and what it is about; frozen, equal where it means the same."""

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits, equal for scenarios that mean the same."""
        ...

    def to_json(self) -> str:
        """Canonical JSON, the text that is attached to a recording."""
        ...


class Settings(Protocol):
    """Settings of a world: a frozen dataclass of numbers, with a default for each."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def step_limit(self) -> int:
        """Steps after which an episode ends as a time-out."""
        ...


class Outcome(NamedTuple):
    """How an episode stands after a step; `reason` is empty while it runs, else one of the task's reasons."""

    done: bool
    success: bool
    reason: str


RUNNING = Outcome(False, False, "")


class World(Protocol):
    """The simulated world of a task: deterministic, advanced one step of `1 / record_hz` s at a time.

    Attributes:
        step_count: steps since the last reset.
    """

    step_count: int

    @property
    def recorded(self) -> tuple[float, ...]:
        """The state as recordings hold it (`TaskSpec.recorded`), exact: `reset` to it goes on bit for bit."""
        ...

    @property
    def observation(self) -> np.ndarray:
        """The state as data sets and agents see it (`TaskSpec.state`), `(n,)`."""
        ...

    def restore(self, recorded: Sequence[float]) -> None:
        """Puts the world into a recorded state and sets the step count to zero."""
        ...

    def step(self, action: np.ndarray) -> Outcome:
        """Advances under a joint action, each number clipped to its bounds."""
        ...

    def reward(self) -> float:
        """Of the present state."""
        ...


class Player(Protocol):
    """A simulated player of one episode."""

    @property
    def changes(self) -> int:
        """How often it has changed its mind, as the task defines it."""
        ...

    def act(self, state: np.ndarray) -> np.ndarray:
        """Its action `(m,)` in a state `(n,)`; called once a step."""
        ...


@dataclass(frozen=True)
class SimulatedPlayers:
    """The part `agents` of a task: players that need neither a person nor a policy.

    Attributes:
        pairs: profiles (frozen dataclasses) of simulated pairs by name, robot seat first.
        partners: profiles of kinds of partner for the human seat, which robots are judged with.
        robots: profile and description of scripted robots, which policies are compared with.
        make_pair: players from scenario, name and seed of a pair, and whatever options the task has.
        make_partner: a player from scenario, kind and seed; equal seeds make equal ones, whoever the robot is.
        make_robot: a player from scenario, name and seed.
    """

    pairs: Mapping[str, tuple[Any, Any]]
    partners: Mapping[str, Any]
    robots: Mapping[str, tuple[Any, str]]
    make_pair: Callable[..., tuple[Player, Player]]
    make_partner: Callable[[Any, str, int], Player]
    make_robot: Callable[[Any, str, int], Player]


class SeatExchange(Protocol):
    """The part `exchange` of a task: the same episode with the robot's and the human's place exchanged.

    Each method is its own inverse. A world in an exchanged state moves under an exchanged action as the first one
    does, so that a policy that has learned the robot's seat can act at the human's.
    """

    def scenario(self, scenario: Any) -> Any:
        """A scenario with the seats exchanged."""
        ...

    def states(self, states: np.ndarray) -> np.ndarray:
        """States `(..., n)` with the seats exchanged."""
        ...

    def actions(self, actions: np.ndarray) -> np.ndarray:
        """Joint actions `(..., 2 m)` with the seats exchanged."""
        ...


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
        record_hz: steps a second.
        players: names of the seats.
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

    @property
    def joint_action(self) -> Vector:
        """Both players' actions, robot first; names begin with the player's."""
        one = self.action
        names = tuple(f"{player}_{name}" for player in self.players for name in one.names)
        return Vector(names, one.units * 2, one.low * 2, one.high * 2)


class PairTask(ABC):
    """A task for two players. A subclass says what is abstract here; every other part is optional.

    What a task does not offer is None (or empty) here; commands leave out what needs it and say so (`missing`).

    Attributes:
        spec: what it is.
        scenario_type: class of its scenarios, which is constructed from JSON by `scenario_of_json`.
        settings_type: class of its settings.
        exchange: how an episode looks from the other seat.
    """

    spec: ClassVar[TaskSpec]
    scenario_type: ClassVar[type]
    settings_type: ClassVar[type]
    exchange: ClassVar[SeatExchange | None] = None

    @property
    def agents(self) -> SimulatedPlayers | None:
        """Simulated players."""
        return None

    @property
    @abstractmethod
    def scenario_sets(self) -> Mapping[str, Sequence[Any]]:
        """Scenarios by the name of their set, in order."""

    @abstractmethod
    def scenario_of_json(self, text: str | bytes) -> Any:
        """The inverse of `Scenario.to_json`.

        Raises:
            InvalidValueError: the text is no scenario.
        """

    @abstractmethod
    def scenario_vector(self, scenario: Any) -> np.ndarray:
        """The vector of a scenario, as `TaskSpec.scenario` names it, `(n,)`."""

    @abstractmethod
    def scenario_of_vector(self, vector: np.ndarray, columns: Mapping[str, Any]) -> Any:
        """The scenario behind a vector `(n,)` of a data set and the columns of its episode.

        Raises:
            InvalidValueError: no scenario has that vector.
        """

    @abstractmethod
    def make_world(self, scenario: Any, settings: Any = None) -> World:
        """A world at the start of a scenario, under the default settings where none are given."""

    def states_of(self, recorded: np.ndarray) -> np.ndarray:
        """States `(T, n)` from recorded ones `(T, k)`, to the last bit those of `World.observation`."""
        return recorded

    def identify(self, scenario: Any) -> tuple[str, str]:
        """Name of a scenario and of its set: `("training-17", "training")`, `("custom-1a2b3c4d", "custom")`."""
        for set_name, scenarios in self.scenario_sets.items():
            for index, known in enumerate(scenarios):
                if known.digest == scenario.digest:
                    return f"{set_name}-{index:02d}", set_name
        return f"custom-{scenario.digest}", "custom"

    def missing(self, part: str) -> str:
        """The sentence with which a command leaves out what needs a part that the task does not offer."""
        return f"left out: the task {self.spec.name!r} has no {part}"


def installed_tasks() -> list[str]:
    """Names of the tasks that are installed, sorted."""
    return sorted({entry.name for entry in entry_points(group=ENTRY_POINTS)})


@functools.cache
def get_task(name: str = "table") -> PairTask:
    """The task of a name.

    Raises:
        UnknownNameError: no such task is installed.
        InvalidValueError: what is registered under the name is no task, or is one of another name.
        CopolicyError: it cannot be imported.
    """
    entries = list(entry_points(group=ENTRY_POINTS, name=name))
    if not entries:
        raise UnknownNameError("task", name, installed_tasks())
    try:
        task = entries[0].load()()
    except Exception as error:
        message = f"task {name!r}: expected {entries[0].value} to be imported, found {type(error).__name__}: {error}"
        raise CopolicyError(message) from error
    if not isinstance(task, PairTask) or task.spec.name != name:
        raise InvalidValueError(f"task {name!r}", "a PairTask of that name", entries[0].value)
    return task
