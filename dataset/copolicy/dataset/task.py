"""What the pipeline must know of a task for two players, and which tasks are installed.

A task is one object, a `PairTask`. `get_task` finds it by its name through the entry point group `copolicy.tasks`; the
tasks that come along are registered there as those of any other package are:

    [project.entry-points."copolicy.tasks"]
    peg = "lab_peg.task:PegTask"

Player 0 is the robot seat, player 1 the human seat. A joint action is both players' actions, robot first.
"""

import functools
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .exceptions import CopolicyError, InvalidValueError, UnknownNameError
from .features import PAIR_GYM_ID
from .outline import Outline
from .scenarios import ScenarioFiles, ScenarioName, ScenarioSet, file_and_split, is_file_name
from .task_parts import (
    RUNNING,
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
    Studies,
    TaskRules,
    TaskStatistics,
    World,
)
from .task_spec import PLAYERS, RECORD_HZ, TaskSpec, Vector
from .task_words import TaskWords

if TYPE_CHECKING:
    from .recording.task_messages import TaskMessages

# The whole contract from one place, for packages that bring a task.
__all__ = [
    "ENTRY_POINTS",
    "PLAYERS",
    "RECORD_HZ",
    "RUNNING",
    "TABLE",
    "Limit",
    "Outcome",
    "PairTask",
    "Player",
    "PolicyFeatures",
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
    "Vector",
    "World",
    "get_task",
    "installed_tasks",
]

TABLE = "table"
"""Name of the task of data, recordings and policies that name none."""

ENTRY_POINTS = "copolicy.tasks"
"""The entry point group in which tasks are registered."""


class PairTask(ABC):
    """A task for two players. A subclass says what is abstract here; every other part is optional.

    What a task does not offer is None (or empty) here; commands leave out what needs it and say so (`missing`).

    Attributes:
        spec: what it is.
        settings_type: class of its settings.
        exchange: how an episode looks from the other seat.
        outline: what it looks like.
        studies: what results of studies say of it.
        orientations: how many start orientations `turned` gives a scenario; 1: there are none.
    """

    spec: ClassVar[TaskSpec]
    settings_type: ClassVar[type]
    exchange: ClassVar[SeatExchange | None] = None
    outline: ClassVar[Outline | None] = None
    studies: ClassVar[Studies] = Studies()
    orientations: ClassVar[int] = 1

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

    def settings_of(self, entries: Mapping[str, Any], where: str = "settings: {}") -> Any:
        """Settings from numbers, or from their digits, by name.

        Args:
            where: what an error calls a setting.

        Raises:
            InvalidValueError: one is missing, is no number, or is not allowed.
        """
        values = {}
        for setting in fields(self.settings_type):
            entry, kind = entries.get(setting.name), type(setting.default)
            if isinstance(entry, bool) or not isinstance(entry, (str, int) if kind is int else (str, int, float)):
                raise InvalidValueError(where.format(setting.name), "a number", entry)
            try:
                values[setting.name] = kind(entry)
            except (ValueError, OverflowError) as error:
                expected = "a number" if isinstance(error, ValueError) else "a finite number"
                raise InvalidValueError(where.format(setting.name), expected, entry) from None
        return self.settings_type(**values)

    @abstractmethod
    def make_world(self, scenario: Any, settings: Any = None) -> World:
        """A world at the start of a scenario, under the default settings where none are given."""

    def start_of(self, scenario: Any) -> tuple[float, ...]:
        """The recorded state at the start of a scenario."""
        return self.make_world(scenario).recorded

    def states_of(self, recorded: np.ndarray) -> np.ndarray:
        """States `(T, n)` from recorded ones `(T, k)`, to the last bit those of `World.observation`."""
        return recorded

    def recorded_of(self, states: np.ndarray) -> np.ndarray:
        """The inverse of `states_of`, as exact as the states allow."""
        return states

    def columns_of(self, scenario: Any) -> dict[str, Any]:
        """Episode columns with what the vector of a scenario does not say."""
        return {}

    def unseen(self, columns: Mapping[str, Any]) -> str:
        """What of these columns a policy would have to know and does not see, in words; empty: nothing."""
        return ""

    def unseen_summary(self, episodes: Sequence[Mapping[str, Any]]) -> str:
        """How many of some episodes, by these columns, have something that no policy sees; empty: none."""
        found = [text for columns in episodes if (text := self.unseen(columns))]
        return f"{len(found)} of {len(episodes)} have what no policy sees: {found[0]}" if found else ""

    def integrate(self, scenario: Any, settings: Any, state: np.ndarray, actions: np.ndarray) -> np.ndarray:
        """States `(T + 1, n)` under joint actions `(T, m)` from a state `(n,)` on, whatever ends there are."""
        world = self.make_world(scenario, settings)
        world.restore(tuple(self.recorded_of(np.asarray(state, float)[None])[0].tolist()))
        states = [world.observation]
        for action in actions:
            world.step(action)
            states.append(world.observation)
        return np.array(states)

    def rewards(self, scenario: Any, states: np.ndarray) -> np.ndarray:
        """The reward of each of some states `(T, n)`, `(T,)`."""
        world, rewards = self.make_world(scenario), []
        for recorded in self.recorded_of(np.asarray(states, float)).tolist():
            world.restore(tuple(recorded))
            rewards.append(world.reward())
        return np.array(rewards)

    @property
    def recording(self) -> "TaskMessages | None":
        """Messages of its own in recordings; None: the generic ones."""
        return None

    def path(self, states: np.ndarray) -> np.ndarray | None:
        """`(T, 2)` the point that figures and statistics follow; None: there is none."""
        return None

    def interaction(self, states: np.ndarray, actions: np.ndarray) -> np.ndarray | None:
        """`(T,)` what passes between the players in states `(T, n)` under actions `(T, m)`; None: not measured."""
        return None

    def interaction_recorded(self, recorded: np.ndarray, actions: np.ndarray) -> np.ndarray | None:
        """The same in recorded states `(T, k)`."""
        return self.interaction(self.states_of(recorded), actions)

    def layout(self, scenario: Any, with_goal: bool = False) -> Hashable:
        """What scenarios share that differ in their start alone, or without `with_goal` in start and goal; sortable."""
        return scenario.digest

    def strategy(self, scenario: Any, states: np.ndarray) -> str:
        """The strategy label of an episode's states `(T + 1, n)`; empty: the task has none."""
        return ""

    def environment(self, settings: Mapping[str, float]) -> tuple[str, dict[str, Any]]:
        """Id of its gymnasium environment and the arguments beside its rate, under settings that are not the usual."""
        steps = {name: value for name, value in settings.items() if name == "step_limit"}
        others = {name: value for name, value in settings.items() if name not in steps}
        return PAIR_GYM_ID, {"task": self.spec.name, **steps, **({"settings": others} if others else {})}

    @property
    def words(self) -> TaskWords:
        """How screens, cards and pages speak of it."""
        return TaskWords.from_spec(self.spec)

    def images(self, scenario: Any, states: np.ndarray, size: tuple[int, int]) -> Iterator[np.ndarray] | None:
        """Of each of some states, `(height, width, 3)` uint8 for a size (width, height); None: it is not drawn."""
        return None

    def view(self, scenario: Any) -> SceneView | None:
        """What draws a scenario on the screen; None: `outline` is drawn as it is."""
        return None

    @property
    def drift_limits(self) -> Mapping[str, float]:
        """What `drift` measures, and up to where two motions are the same: here a hundred thousandth of the bounds."""
        vector = self.spec.recorded
        limits = 1e-5 * (np.array(vector.high) - np.array(vector.low))
        return dict(zip(vector.names, limits.tolist(), strict=True))

    def drift(self, recorded: np.ndarray, other: np.ndarray) -> np.ndarray:
        """`(T, len(drift_limits))` how far apart recorded states `(T, k)` of two motions are, step by step.

        A task with angles in its state says what a whole turn is.
        """
        return np.abs(recorded - other)

    def displaced(self, scenario: Any, scale: float, rng: np.random.Generator) -> Any:
        """A scenario that begins beside its start, by up to `scale` times what the task sees fit.

        Raises:
            InvalidValueError: the task has none.
        """
        raise InvalidValueError("--start-noise", "no such flag", self.missing("displaced starts"))

    def balanced(self, scenario: Any) -> tuple[Hashable, ...]:
        """What a session balances beside scenarios, such as their starts; each scenario has as many."""
        return ()

    @property
    def statistics(self) -> TaskStatistics:
        """What statistics are computed by, and statistics beside the generic ones."""
        return TaskStatistics()

    @property
    def rules(self) -> TaskRules:
        """Rules of `check` and their limits beside the generic ones."""
        return TaskRules()

    @property
    def features(self) -> PolicyFeatures:
        """Observation encoders and symmetries of policies; torch is imported for them here, and nowhere before."""
        return PolicyFeatures()

    def settings_summary(self, settings: Any) -> str:
        """Settings in words: what is not the default."""
        default = asdict(self.settings_type())
        others = [f"{name} {value:g}" for name, value in asdict(settings).items() if value != default[name]]
        return ", ".join(others) or "default"

    def identify(self, scenario: Any) -> tuple[str, str]:
        """Name of a scenario and of its set: `("training-17", "training")`, `("custom-1a2b3c4d", "custom")`."""
        for set_name, scenarios in self.scenario_sets.items():
            for index, known in enumerate(scenarios):
                if known.digest == scenario.digest:
                    return f"{set_name}-{index:02d}", set_name
        return f"custom-{scenario.digest}", "custom"

    def name_of(self, scenario: Any) -> ScenarioName:
        """Name of a scenario, of its set, and of the file that it is from; its `columns` go into recordings."""
        return ScenarioName(*self.identify(scenario))

    @property
    def scenario_files(self) -> ScenarioFiles | None:
        """How scenarios are written into files."""
        return None

    def scenario_set(self, text: str) -> ScenarioSet:
        """The scenarios behind `--maps`: the name of a set, a file, or one of its splits as `FILE#split`.

        Raises:
            UnknownNameError: no such set or split.
            FileFormatError: the file is none, has a problem, or is of another task.
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
        chosen = self.scenario_files.read(Path(path))
        return chosen.part(split) if split else chosen

    def turned(self, chosen: ScenarioSet) -> ScenarioSet:
        """A set with each scenario in several start orientations.

        Raises:
            InvalidValueError: the task has none.
        """
        raise InvalidValueError("--orientations", "no such flag", self.missing("start orientations"))

    def offers(self, part: str) -> bool:
        """Whether the task brings a part of its own, such as `strategy` or `interaction`."""
        return getattr(type(self), part) is not getattr(PairTask, part)

    @property
    def required_outline(self) -> Outline:
        """The outline, for what cannot do without.

        Raises:
            CopolicyError: there is none.
        """
        if self.outline is None:
            raise CopolicyError(self.missing("outline"))
        return self.outline

    def missing(self, part: str) -> str:
        """The sentence with which a command leaves out what needs a part that the task does not offer."""
        return f"left out: the task {self.spec.name!r} has no {part}"


def installed_tasks() -> list[str]:
    """Names of the tasks that are installed, sorted."""
    return sorted({entry.name for entry in entry_points(group=ENTRY_POINTS)})


def distribution_of(task: PairTask) -> str | None:
    """Name of the installed package that registers a task."""
    package = next(iter(entry_points(group=ENTRY_POINTS, name=task.spec.name))).dist
    return None if package is None else package.name


@functools.cache
def get_task(name: str = TABLE) -> PairTask:
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
