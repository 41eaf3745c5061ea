"""The part `studies` of a task, and published results of its studies."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, NamedTuple

from .arrays import Array
from .trajectory_figures import TrajectoryFigures


class PublishedFront(NamedTuple):
    """Published success of a method in one set-up of a study with people (see `Studies.fronts`).

    `sd` is the standard deviation between people of their success, `printed_sd` what the publication prints as such.
    """

    successes: int
    trials: int
    people: int
    sd: float
    printed_sd: float


@dataclass(frozen=True)
class PublishedPeople:
    """Published results of a method in the studies with people of a task.

    Attributes:
        success: mean over people of the study in simulation, in [0, 1].
        wall_time_s: mean wall time of its successes, s.
        fronts: success by set-up, of the study with a real robot.
    """

    success: float
    wall_time_s: float
    fronts: Mapping[str, PublishedFront] = field(default_factory=dict)


@dataclass(frozen=True)
class PublishedMethod:
    """Published results of a method in the studies of a task.

    Attributes:
        name: name in the publication.
        policies: values by which the configuration of a policy is recognised as this method: any of the values, for
            each setting.
        best: successes and episodes of the best training seed, by scenario set.
        mean: successes and episodes of all training seeds, by scenario set.
        planning_ms: mean time of one decision, ms; None if it was not published.
        people: its results beside people; None if they were not published.
    """

    name: str
    policies: Mapping[str, tuple[Any, ...]]
    best: Mapping[str, tuple[int, int]]
    mean: Mapping[str, tuple[int, int]]
    planning_ms: float | None = None
    people: PublishedPeople | None = None

    def is_of(self, config: Mapping[str, Any]) -> bool:
        """Whether a policy with these settings is an implementation of the method."""
        return all(config.get(setting) in values for setting, values in self.policies.items())


class Studies:
    """The part `studies` of a task: its additions to study results.

    Attributes:
        step_limit: steps after which an episode of a study ends; None for the limit in the settings.
        definitions: definitions of measures for this task, by their names in results.
        published: published results of the co-planning study, for comparison, in the order of the publication.
        published_source: source of `published` and how it was measured.
        published_people_source: source of the results beside people, and how they were measured.
        fronts: names of the set-ups of a study with people: whose end of the body points to the goal; empty for a task
            without ends.
        near_miss: distance to an obstacle below which a pass counts as a near miss, in the unit of the outline; None if
            not defined.
        figures: cell sizes and thresholds of the figures of trajectories; None for cells of 1/100 and 1/24 of the
            scene's width, without a map of the interaction measure.
    """

    step_limit: int | None = None
    near_miss: float | None = None
    figures: TrajectoryFigures | None = None
    definitions: Mapping[str, str] = MappingProxyType({})
    published: tuple[PublishedMethod, ...] = ()
    published_source: str = ""
    published_people_source: str = ""
    fronts: tuple[str, ...] = ()

    def front(self, scenario: Any) -> str:
        """The set-up of a scenario, one of `fronts`; empty if neither end points to the goal."""
        return ""

    def with_front(self, scenario: Any, front: str) -> Any:
        """The scenario in a set-up, one of `fronts`."""
        raise NotImplementedError(f"a task with fronts turns its scenarios: {front}")

    def factors(self, scenario: Any) -> dict[str, Any]:
        """Columns for the result of an episode, as JSON values.

        Results are grouped by `start_theta` (rad) and `obstacles` (count), those of a cross-play by each factor with 2
        to 12 values.
        """
        return {}

    def at_rest(self, recorded: Array) -> Array | None:
        """`(T,)` whether the body is at rest in recorded states `(T, k)`; None if not measured."""
        return None

    def strategy_actions(self, scenario: Any, states: Array) -> tuple[tuple[str, ...], Array] | None:
        """The actions with which each player would pursue each strategy, to recognise which one a player prefers.

        Args:
            states: `(T, n)`.

        Returns:
            The R strategy labels, see `PairTask.strategy`; `(T, 2, R, m)` actions, robot first, NaN where a strategy is
            out of reach. None if the task does not define them, or not for this scenario.
        """
        return None
