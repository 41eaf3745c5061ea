"""The contract of a two-player task, and the lookup of installed tasks.

A task is one object, a `PairTask`. `get_task` finds it by name through the entry point group `copolicy.tasks`, in which
any package can register tasks:

    [project.entry-points."copolicy.tasks"]
    peg = "lab_peg.task:PegTask"

Player 0 is the robot seat, player 1 the human seat. A joint action is both players' actions, robot first. In the shapes
below n is the length of a state, k that of a recorded state, m that of one player's action.
"""

import functools
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .arrays import Array
from .exceptions import CopolicyError, InvalidValueError, UnknownNameError
from .features import PAIR_GYM_ID
from .outline import Outline
from .scenarios import ScenarioFiles, ScenarioName, ScenarioSet, file_and_split, is_file_name
from .task_parts import (
    RUNNING,
    BodyMotion,
    Limit,
    Outcome,
    Player,
    PolicyFeatures,
    Rule,
    Scenario,
    SceneView,
    SeatExchange,
    Settings,
    SimulatedPlayers,
    TaskRules,
    TaskStatistics,
    World,
)
from .task_spec import PLAYERS, RECORD_HZ, TaskSpec, Vector
from .task_studies import PublishedFront, PublishedMethod, PublishedPeople, Studies
from .task_words import TaskWords
from .trajectory_figures import PublishedFigures, TrajectoryFigures

if TYPE_CHECKING:
    from .recording.task_messages import TaskMessages

# The whole contract in one place, for packages that define a task.
__all__ = [
    "ENTRY_POINTS",
    "PLAYERS",
    "RECORD_HZ",
    "RUNNING",
    "TABLE",
    "BodyMotion",
    "Limit",
    "Outcome",
    "PairTask",
    "Player",
    "PolicyFeatures",
    "PublishedFigures",
    "PublishedFront",
    "PublishedMethod",
    "PublishedPeople",
    "Rule",
    "Scenario",
    "SceneView",
    "SeatExchange",
    "Settings",
    "SimulatedPlayers",
    "Studies",
    "TaskRules",
    "TaskSpec",
    "TaskStatistics",
    "TaskWords",
    "TrajectoryFigures",
    "Vector",
    "World",
    "get_task",
    "installed_tasks",
]

TABLE = "table"
"""The default task: that of recordings, data sets and policies that state no task."""

ENTRY_POINTS = "copolicy.tasks"
"""The entry point group in which tasks are registered."""


class PairTask(ABC):
    """A two-player task. A subclass implements the abstract members; every other part is optional.

    An optional part that a task lacks is None or empty; commands skip what needs it and report so (`missing`).

    Attributes:
        spec: name, vectors, rate and termination reasons.
        settings_type: class of the world settings, see `Settings`.
        exchange: exchange of the two seats.
        outline: shapes of the task for figures, pages and videos.
        studies: task-specific parts of study results.
        orientations: number of start orientations that `turned` gives each scenario; 1 if the task has none.
    """

    spec: ClassVar[TaskSpec]
    settings_type: ClassVar[type]
    exchange: ClassVar[SeatExchange | None] = None
    outline: ClassVar[Outline | None] = None
    studies: ClassVar[Studies] = Studies()
    orientations: ClassVar[int] = 1

    @property
    def agents(self) -> SimulatedPlayers | None:
        """Scripted agents."""
        return None

    @property
    @abstractmethod
    def scenario_sets(self) -> Mapping[str, Sequence[Any]]:
        """Named sets of scenarios, each in order."""

    @abstractmethod
    def scenario_of_json(self, text: str | bytes) -> Any:
        """Parses a scenario, the inverse of `Scenario.to_json`.

        Raises:
            InvalidValueError: the text is not a scenario.
        """

    @abstractmethod
    def scenario_vector(self, scenario: Any) -> Array:
        """The vector of a scenario, `(len(TaskSpec.scenario),)`."""

    @abstractmethod
    def scenario_of_vector(self, vector: Array, columns: Mapping[str, Any]) -> Any:
        """The scenario of a vector `(n,)` and the episode columns that complete it, see `columns_of`.

        Raises:
            InvalidValueError: no scenario has this vector.
        """

    def settings_of(self, entries: Mapping[str, Any], label: str = "settings: {}") -> Any:
        """Settings from numbers or their decimal text, by name.

        Args:
            label: format of a setting's name in errors.

        Raises:
            InvalidValueError: a setting is missing, is not a number, or is out of range.
        """
        values = {}
        for setting in fields(self.settings_type):
            entry, number_type = entries.get(setting.name), type(setting.default)
            if isinstance(entry, bool) or not isinstance(
                entry, (str, int) if number_type is int else (str, int, float)
            ):
                raise InvalidValueError(label.format(setting.name), "a number", entry)
            try:
                values[setting.name] = number_type(entry)
            except (ValueError, OverflowError) as error:
                expected = "a number" if isinstance(error, ValueError) else "a finite number"
                raise InvalidValueError(label.format(setting.name), expected, entry) from None
        return self.settings_type(**values)

    @abstractmethod
    def make_world(self, scenario: Any, settings: Any = None) -> World:
        """A world at the start of a scenario; default settings if None."""

    def start_of(self, scenario: Any) -> tuple[float, ...]:
        """The recorded state at the start of a scenario."""
        return self.make_world(scenario).recorded

    def states_of(self, recorded: Array) -> Array:
        """States `(T, n)` of recorded states `(T, k)`, bit-identical to `World.observation`."""
        return recorded

    def recorded_of(self, states: Array) -> Array:
        """Recorded states `(T, k)` of states `(T, n)`: the inverse of `states_of`, up to rounding."""
        return states

    def columns_of(self, scenario: Any) -> dict[str, Any]:
        """Episode columns with the information about a scenario that its vector lacks."""
        return {}

    def unseen(self, columns: Mapping[str, Any]) -> str:
        """Description of a property in these episode columns that policies do not observe; empty if there is none."""
        return ""

    def unseen_summary(self, episodes: Sequence[Mapping[str, Any]]) -> str:
        """Number of episodes with a property that policies do not observe, with an example; empty if there are none."""
        summaries = [text for columns in episodes if (text := self.unseen(columns))]
        return (
            f"{len(summaries)} of {len(episodes)} have a property that no policy observes: {summaries[0]}"
            if summaries
            else ""
        )

    def integrate(self, scenario: Any, settings: Any, state: Array, actions: Array) -> Array:
        """States `(T + 1, n)` under joint actions `(T, 2 m)` from a state `(n,)`, also after the end of the episode."""
        world = self.make_world(scenario, settings)
        world.restore(tuple(self.recorded_of(np.asarray(state, float)[None])[0].tolist()))
        states = [world.observation]
        for action in actions:
            world.step(action)
            states.append(world.observation)
        return np.array(states)

    def rewards(self, scenario: Any, states: Array) -> Array:
        """`(T,)` rewards of states `(T, n)`."""
        world, rewards = self.make_world(scenario), []
        for recorded in self.recorded_of(np.asarray(states, float)).tolist():
            world.restore(tuple(recorded))
            rewards.append(world.reward())
        return np.array(rewards)

    @property
    def recording(self) -> "TaskMessages | None":
        """Message types of the task in recordings; None for the generic ones."""
        return None

    def path(self, states: Array) -> Array | None:
        """`(T, 2)` positions of the tracked point, for figures and statistics; None if the task tracks none."""
        return None

    def tracked_path(self, states: Array) -> Array | None:
        """`path`, or else `(T, 2)` positions of the outline's body; None if the task has neither."""
        path = self.path(states)
        return path if path is not None or self.outline is None else self.outline.poses(states)[:, :2]

    def interaction(self, states: Array, actions: Array) -> Array | None:
        """`(T,)` interaction measure in states `(T, n)` under joint actions `(T, 2 m)`; None if the task has none."""
        return None

    def interaction_recorded(self, recorded: Array, actions: Array) -> Array | None:
        """`interaction` in recorded states `(T, k)`."""
        return self.interaction(self.states_of(recorded), actions)

    def layout(self, scenario: Any, with_goal: bool = False) -> Hashable:
        """Sortable key, equal for scenarios that differ only in the start, or without `with_goal` in start and goal."""
        return scenario.digest

    def strategy(self, scenario: Any, states: Array) -> str:
        """The strategy label of an episode with states `(T + 1, n)`; empty if the task has no labels."""
        return ""

    def environment(self, settings: Mapping[str, float]) -> tuple[str, dict[str, Any]]:
        """Gymnasium id and arguments (except the rate) of the task's environment under non-default settings."""
        step_limit = {name: value for name, value in settings.items() if name == "step_limit"}
        changed = {name: value for name, value in settings.items() if name not in step_limit}
        return PAIR_GYM_ID, {"task": self.spec.name, **step_limit, **({"settings": changed} if changed else {})}

    @property
    def words(self) -> TaskWords:
        """Phrases about the task for screens, cards, pages and figures."""
        return TaskWords.from_spec(self.spec)

    def images(self, scenario: Any, states: Array, size: tuple[int, int]) -> Iterator[Array] | None:
        """An image `(height, width, 3)` uint8 of each state, for a size (width, height) in px; None if not drawn."""
        return None

    def view(self, scenario: Any) -> SceneView | None:
        """The view that draws a scenario on the screen; None to draw `outline`."""
        return None

    @property
    def drift_limits(self) -> Mapping[str, float]:
        """Largest `drift` of two equal motions, by the name of each measure; by default 1e-5 of the bounds' range."""
        vector = self.spec.recorded
        limits = 1e-5 * (np.array(vector.high) - np.array(vector.low))
        return dict(zip(vector.names, limits.tolist(), strict=True))

    def drift(self, recorded: Array, reference: Array) -> Array:
        """`(T, len(drift_limits))` distances between the recorded states `(T, k)` of two motions at each step.

        A task with angles in its recorded state must override this, so that a full turn is no distance.
        """
        return np.abs(recorded - reference)

    def displaced(self, scenario: Any, scale: float, rng: np.random.Generator) -> Any:
        """A scenario with a random start near its own, up to `scale` times the displacement that the task defines.

        Raises:
            InvalidValueError: the task has no displaced starts.
        """
        raise InvalidValueError("--start-noise", "no such flag", self.missing("displaced starts"))

    def balanced(self, scenario: Any) -> tuple[Hashable, ...]:
        """Factors of a scenario that a session balances, such as its start; the same number for every scenario."""
        return ()

    @property
    def statistics(self) -> TaskStatistics:
        """Inputs of the generic statistics, and statistics of the task."""
        return TaskStatistics()

    @property
    def rules(self) -> TaskRules:
        """Rules and limits of the task for `copolicy-dataset check`, in addition to the generic ones."""
        return TaskRules()

    @property
    def features(self) -> PolicyFeatures:
        """Observation encoders and symmetries for policies. Import torch here, not at the top of a task's module."""
        return PolicyFeatures()

    @property
    def motion(self) -> BodyMotion | None:
        """Planar motion of the body, for policies that plan it. Import torch here, not at the top of the module."""
        return None

    def settings_summary(self, settings: Any) -> str:
        """Readable text of the settings that differ from the defaults; `default` if none does."""
        default = asdict(self.settings_type())
        changed = [f"{name} {value:g}" for name, value in asdict(settings).items() if value != default[name]]
        return ", ".join(changed) or "default"

    def identify(self, scenario: Any) -> tuple[str, str]:
        """Names of a scenario and its set: `("training-17", "training")`, `("custom-1a2b3c4d", "custom")`."""
        for set_name, scenarios in self.scenario_sets.items():
            for index, candidate in enumerate(scenarios):
                if candidate.digest == scenario.digest:
                    return f"{set_name}-{index:02d}", set_name
        return f"custom-{scenario.digest}", "custom"

    def name_of(self, scenario: Any) -> ScenarioName:
        """Names of a scenario and its set, and the version of the file that it is from."""
        return ScenarioName(*self.identify(scenario))

    @property
    def scenario_files(self) -> ScenarioFiles | None:
        """Reader and writer of scenario files; None if the task has none."""
        return None

    def scenario_set(self, text: str) -> ScenarioSet:
        """The scenarios for a value of `--maps`: the name of a set, a file, or a split of it as `FILE#split`.

        Raises:
            UnknownNameError: no such set or split.
            FileFormatError: the file does not exist, has a problem, or is of another task.
            InvalidValueError: the task has no scenario files.
        """
        if text in self.scenario_sets:
            scenarios = tuple(self.scenario_sets[text])
            return ScenarioSet(self.spec.name, text, "1", scenarios, (1,) * len(scenarios))
        if not is_file_name(text):
            raise UnknownNameError("map set", text, self.scenario_sets)
        if self.scenario_files is None:
            raise InvalidValueError("--maps", f"a set ({self.missing('scenario files')})", text)
        path, split = file_and_split(text)
        file_set = self.scenario_files.read(Path(path))
        return file_set.for_split(split) if split else file_set

    def turned(self, scenario_set: ScenarioSet) -> ScenarioSet:
        """A set with each scenario in `orientations` start orientations.

        Raises:
            InvalidValueError: the task has no start orientations.
        """
        raise InvalidValueError("--orientations", "no such flag", self.missing("start orientations"))

    def offers(self, part: str) -> bool:
        """Whether the task overrides an optional part, such as `strategy` or `interaction`."""
        return getattr(type(self), part) is not getattr(PairTask, part)

    @property
    def required_outline(self) -> Outline:
        """The outline of the task.

        Raises:
            CopolicyError: the task has none.
        """
        if self.outline is None:
            raise CopolicyError(self.missing("outline"))
        return self.outline

    def missing(self, part: str) -> str:
        """The message of a command that skips what needs a part that the task lacks."""
        return f"left out: the task {self.spec.name!r} has no {part}"


def installed_tasks() -> list[str]:
    """Sorted names of the installed tasks."""
    return sorted({entry.name for entry in entry_points(group=ENTRY_POINTS)})


def distribution_of(task: PairTask) -> str | None:
    """Name of the installed package that registers a task; None if unknown."""
    package = next(iter(entry_points(group=ENTRY_POINTS, name=task.spec.name))).dist
    return None if package is None else package.name


def get_task(name: str = TABLE) -> PairTask:
    """The installed task with a name: one object for each name.

    Raises:
        UnknownNameError: no such task is installed.
        InvalidValueError: the object registered under the name is not a `PairTask` of that name.
        CopolicyError: the task cannot be imported.
    """
    return load_task(name)


@functools.cache  # its own function, since a cache takes `get_task()` and `get_task("table")` for two calls
def load_task(name: str) -> PairTask:
    """As `get_task`; `load_task.cache_clear` forgets the tasks after a package was removed."""
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
