"""What a task is made of: scenarios, settings, the world, and the parts that it may offer beside them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from .outline import Point, Pose


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
        """A field: steps after which an episode ends with the reason `timeout`."""
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
        """Advances under a joint action, each number clipped to its bounds; after an end, too."""
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
        options: names of what `make_pair` takes beside these; `clearance` is behind the flag of that name.
    """

    pairs: Mapping[str, tuple[Any, Any]]
    partners: Mapping[str, Any]
    robots: Mapping[str, tuple[Any, str]]
    make_pair: Callable[..., tuple[Player, Player]]
    make_partner: Callable[[Any, str, int], Player]
    make_robot: Callable[[Any, str, int], Player]
    options: tuple[str, ...] = ()


class SceneView(Protocol):
    """What `PairTask.view` gives: draws one scenario and what moves in it on pygame surfaces of any size."""

    def draw(
        self,
        surface: Any,
        area: Any,
        pose: Pose,
        forces: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
        trail: Sequence[Pose] = (),
    ) -> Any:
        """Draws the scene into the middle of an area, in its own shape, and returns the rectangle that it fills.

        Args:
            surface: a `pygame.Surface`.
            area: a `pygame.Rect`.
            pose: of the body, see `Outline.poses`.
            forces: of both players, see `Outline.forces`.
            trail: earlier poses, oldest first.
        """
        ...

    def to_screen(self, point: Point) -> Point:
        """Where a point of the scene was drawn last, px of the surface."""
        ...


class Studies:
    """The part `studies` of a task: what results of studies say of it beside what they say of any task.

    Attributes:
        step_limit: steps after which an episode of a study ends; None: as the settings of the task have it.
        definitions: what measures are in this task, in words by their names in results.
    """

    step_limit: int | None = None
    definitions: Mapping[str, str] = MappingProxyType({})

    def factors(self, scenario: Any) -> dict[str, Any]:
        """Columns of an episode's row; results are split by `start_theta` (rad) and `obstacles` (a count), if any."""
        return {}

    def at_rest(self, recorded: np.ndarray) -> np.ndarray | None:
        """`(T,)` whether what is moved stands, in recorded states `(T, k)`; None: not measured."""
        return None


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
class PolicyFeatures:
    """What a task offers to policies beside the generic input, which is its scaled columns; by name.

    Attributes:
        encoders: each is called with whether the human's past action is seen, and gives a torch module with a `size`
            that makes `(..., size)` of observation columns `(..., n)` in physical units.
        symmetries: each makes other training samples `{column: (B, T, n)}`, as true, of some; applied in this order.
    """

    encoders: Mapping[str, Callable[[bool], Any]] = field(default_factory=dict)
    symmetries: Mapping[str, Callable[[dict[str, Any]], dict[str, Any]]] = field(default_factory=dict)


@dataclass(frozen=True)
class TaskStatistics:
    """The part `statistics` of a task: what its statistics are computed by, and those that it alone has.

    Attributes:
        people: what a data set of people is.
        velocity: places in the state of the velocity of what moves, an axis of a player's action each; empty where
            there is none: no statistics of speed and of work.
        interaction: definition of the interaction measure.
        interaction_unit: of it.
        label_bits: bits that a strategy label can tell at most; None where nobody knows.
        families: by family, computes estimates from trajectories, bootstrap and generator: further ones of a family
            of `compute_statistics`, some in the place of generic ones, or a family of its own.
        reference: what people did elsewhere, as a part of the document, from a generator.
    """

    people: str = "people took part"
    velocity: tuple[int, ...] = ()
    interaction: str = "Size of what passes between the players, as the task measures it."
    interaction_unit: str = "1"
    label_bits: Callable[[str], int] | None = None
    families: Mapping[str, Callable[..., dict[str, Any]]] = field(default_factory=dict)
    reference: Callable[[np.random.Generator], dict[str, Any]] | None = None


@dataclass(frozen=True)
class Limit:
    """A number and why it is that one; `{hz}` in its unit stands for the task's steps a second."""

    value: float
    unit: str
    reason: str


@dataclass(frozen=True)
class Rule:
    """One rule.

    Attributes:
        what: what it looks after; where `find` is None, the part that a task lacks without a rule of this name.
        find: yields the findings of an `EpisodeData`; None in the place of a rule that only a task can bring.
        frames: columns of the frames that it reads.
        columns: episode columns that it reads.
        kinds: the kinds of data that it says something about.
        whole: it compares episodes with each other, or says something of the files as they lie; a part of the episodes
            is not enough to apply it.
    """

    name: str
    what: str
    find: Callable[[Any], Iterable[Any]] | None = None
    frames: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ("lerobot", "recordings")
    whole: bool = False


@dataclass(frozen=True)
class TaskRules:
    """The part `rules` of a task.

    Attributes:
        rules: of its own; one with the name of a generic rule stands in its place, the others come last.
        limits: of its own rules, and those of generic rules that it sets otherwise; None where it does without.
    """

    rules: tuple[Rule, ...] = ()
    limits: Mapping[str, Limit | None] = field(default_factory=dict)
