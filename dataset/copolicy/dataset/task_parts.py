"""Types of the task contract: scenario, settings, world, and the optional parts of a task."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from .arrays import Array
from .outline import Point, Pose


class Scenario(Protocol):
    """Start, goal and obstacles of an episode; frozen, compared by value."""

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits, equal for equal scenarios."""
        ...

    def to_json(self) -> str:
        """Canonical JSON, attached to recordings."""
        ...


class Settings(Protocol):
    """World settings: a frozen dataclass of numbers with defaults."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def step_limit(self) -> int:
        """Steps after which an episode ends with the reason `timeout`; a field of the dataclass."""
        ...


class Outcome(NamedTuple):
    """State of an episode after a step; `reason` is empty while it runs, else one of `TaskSpec.reasons`."""

    done: bool
    success: bool
    reason: str


RUNNING = Outcome(False, False, "")


class World(Protocol):
    """The simulated world of a task: deterministic, advanced one step of `1 / record_hz` s at a time.

    Attributes:
        step_count: steps since the last `restore`.
    """

    step_count: int

    @property
    def recorded(self) -> tuple[float, ...]:
        """The exact state as recordings store it (`TaskSpec.recorded`): after `restore` the motion is bit-identical."""
        ...

    @property
    def observation(self) -> Array:
        """The state that data sets store and agents observe (`TaskSpec.state`), `(n,)`."""
        ...

    def restore(self, recorded: Sequence[float]) -> None:
        """Sets the world to a recorded state and the step count to zero."""
        ...

    def step(self, action: Array) -> Outcome:
        """Advances one step under a joint action, clipped to its bounds; also after the end of an episode."""
        ...

    def reward(self) -> float:
        """Reward of the current state."""
        ...


class Player(Protocol):
    """A scripted agent at one seat, for one episode."""

    @property
    def changes(self) -> int:
        """Number of changes of strategy so far, as the task defines them."""
        ...

    def act(self, state: Array) -> Array:
        """The action `(m,)` in a state `(n,)`; called once per step."""
        ...


@dataclass(frozen=True)
class SimulatedPlayers:
    """The part `agents` of a task: its scripted agents.

    Attributes:
        pairs: profiles (frozen dataclasses) of scripted pairs by name, robot seat first.
        partners: profiles of the partner kinds at the human seat with which robots are evaluated.
        robots: profile and description of the scripted robots with which policies are compared.
        make_pair: two agents from scenario, name and seed of a pair, and the keyword arguments in `options`.
        make_partner: an agent from scenario, partner kind and seed; equal for equal seeds, whatever the robot.
        make_robot: an agent from scenario, name and seed.
        options: names of further keyword arguments of `make_pair`; `clearance` is set by the flag `--clearance`.
        default_pairs: names of the pairs that `copolicy-collect simulate` uses without `--pairs`; all if empty.
        make_human_like: an agent at the human's seat of usual habits, from scenario, seed and reaction delay (s),
            without force noise of its own; None if the task has none.
    """

    pairs: Mapping[str, tuple[Any, Any]]
    partners: Mapping[str, Any]
    robots: Mapping[str, tuple[Any, str]]
    make_pair: Callable[..., tuple[Player, Player]]
    make_partner: Callable[[Any, str, int], Player]
    make_robot: Callable[[Any, str, int], Player]
    options: tuple[str, ...] = ()
    default_pairs: tuple[str, ...] = ()
    make_human_like: Callable[[Any, int, float], Player] | None = None


class SceneView(Protocol):
    """Draws one scenario and its moving body on pygame surfaces of any size; made by `PairTask.view`."""

    def draw(
        self,
        surface: Any,
        area: Any,
        pose: Pose,
        forces: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
        trail: Sequence[Pose] = (),
    ) -> Any:
        """Draws the scene centred in an area with its own aspect ratio, and returns the rectangle that it fills.

        Args:
            surface: a `pygame.Surface`.
            area: a `pygame.Rect`.
            pose: pose of the body, see `Outline.poses`.
            forces: forces of both players, see `Outline.forces`.
            trail: earlier poses, oldest first.
        """
        ...

    def to_screen(self, point: Point) -> Point:
        """Surface coordinates (px) of a scene point in the last drawing."""
        ...


class SeatExchange(Protocol):
    """The part `exchange` of a task: exchanges the robot's and the human's seat.

    Each method is its own inverse. The dynamics commute with the exchange, so that a policy trained for the robot's
    seat can act at the human's.
    """

    def scenario(self, scenario: Any) -> Any:
        """A scenario with the seats exchanged."""
        ...

    def states(self, states: Array) -> Array:
        """States `(..., n)` with the seats exchanged."""
        ...

    def actions(self, actions: Array) -> Array:
        """Joint actions `(..., 2 m)` with the seats exchanged."""
        ...


@dataclass(frozen=True)
class PolicyFeatures:
    """Observation encoders and symmetries of a task, by name; the generic policy input is the scaled columns.

    Attributes:
        encoders: factories, called with whether the policy observes the human's past action. Each returns a torch
            module with an attribute `size` that maps observation columns `(..., n)` in physical units to `(..., size)`.
        symmetries: functions that augment training samples `{column: (B, T, n)}` by a symmetry of the task, applied in
            this order.
    """

    encoders: Mapping[str, Callable[[bool], Any]] = field(default_factory=dict)
    symmetries: Mapping[str, Callable[[dict[str, Any]], dict[str, Any]]] = field(default_factory=dict)


class BodyMotion(Protocol):
    """The part `motion` of a task: the motion of the carried body in a plane, for policies that plan it (in torch).

    A pose `(..., 4)` is the position x, y and the cosine and sine of the orientation. A velocity or a wrench `(..., 3)`
    is along x, along y, and about the body's centre, in the axes of the scene. A point that is zero is absent.

    Attributes:
        speed: greatest speed of the centre along an axis that both players sustain, units of position per s.
        reach: distance of the players from the centre, at which rotations compare with displacements.
        full_force: force of a player's action of 1.
        inertia: mass along x, along y, and moment of inertia; a wrench divided by it is an acceleration.
        damping: wrench per velocity that friction takes, along x, along y, and about the centre.
        points: names of the points of a scenario, the goal first, then obstacles.
    """

    speed: float
    reach: float
    full_force: float
    inertia: tuple[float, float, float]
    damping: tuple[float, float, float]
    points: tuple[str, ...]

    def poses(self, states: Any) -> Any:
        """Poses `(..., 4)` in states `(..., n)`."""
        ...

    def velocities(self, states: Any) -> Any:
        """Velocities `(..., 3)` in states `(..., n)`."""
        ...

    def states(self, poses: Any, velocities: Any) -> Any:
        """States `(..., n)` of poses `(..., 4)` and velocities `(..., 3)`."""
        ...

    def scenario_points(self, scenarios: Any) -> Any:
        """The points `(..., len(points), 2)` of scenario vectors `(..., k)`, in the axes of the scene."""
        ...

    def to_body(self, vectors: Any, poses: Any) -> Any:
        """Vectors `(..., 2)` of the scene in the axes of the body at poses `(..., 4)`."""
        ...

    def to_scene(self, vectors: Any, poses: Any) -> Any:
        """The inverse of `to_body`."""
        ...

    def rewards(self, poses: Any, scenarios: Any) -> Any:
        """`(...)` rewards of poses `(..., 4)` in scenarios `(..., k)`; see `World.reward`."""
        ...

    def joint_actions(self, wrenches: Any, poses: Any) -> Any:
        """The smallest joint actions `(..., 2 m)` that exert wrenches `(..., 3)` at poses `(..., 4)`, not clipped."""
        ...


@dataclass(frozen=True)
class TaskStatistics:
    """The part `statistics` of a task: inputs of the generic statistics, and statistics of the task.

    Attributes:
        people: description of a data set recorded with people.
        velocity: indices of the body's velocity in the state, one per axis of a player's action; empty if the state has
            none, which omits statistics of speed and work.
        interaction: definition of the interaction measure.
        interaction_unit: unit of the interaction measure.
        label_bits: maximum information in a strategy label, bits; None if unknown.
        families: functions of trajectories, bootstrap and generator by statistics family; their estimates add to or
            replace those of a family of `compute_statistics`, or form a new family.
        reference: computes published statistics of people, for comparison, from a generator.
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
    """The limit of a rule with its reason; `{hz}` in the unit stands for the task's steps per second."""

    value: float
    unit: str
    reason: str


@dataclass(frozen=True)
class Rule:
    """One rule of `copolicy-dataset check`.

    Attributes:
        what: short description; if `find` is None, the name of the missing part for the report.
        find: yields the findings in an `EpisodeData`; None for a rule that only a task can define.
        frames: frame columns that the rule needs.
        columns: episode columns that the rule needs.
        kinds: kinds of data to which the rule applies.
        whole: whether the rule needs the whole data set: it compares episodes or checks the files.
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
        rules: rules of the task; a rule with the name of a generic rule replaces it, the others come last.
        limits: limits of these rules, and overridden limits of generic rules; None removes a limit.
    """

    rules: tuple[Rule, ...] = ()
    limits: Mapping[str, Limit | None] = field(default_factory=dict)
