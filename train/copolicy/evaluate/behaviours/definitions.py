"""The behaviours that are counted, with their definitions and null distributions."""

import functools
import math
from collections.abc import Callable
from typing import Literal, NamedTuple

from copolicy.dataset.arrays import Array
from copolicy.dataset.statistics.forces import MIN_EFFORT
from copolicy.dataset.task import PairTask, Studies

from . import adaptation, forces, leadership, pivot
from .motion import Event, Motion

NullMethod = Literal["shift", "obstacles"]

MIN_SHIFT_S = 2.0
"""Smallest circular shift of a null distribution, s."""

NULLS: dict[NullMethod, str] = {
    "shift": f"the human's actions circularly shifted in time within each episode by at least {MIN_SHIFT_S:g} s, or by "
    f"half of an episode shorter than {2 * MIN_SHIFT_S:g} s",
    "obstacles": "the obstacles of each episode replaced by those of another one with a different layout",
}


class Behaviour(NamedTuple):
    """One behaviour.

    Attributes:
        name: in results.
        definition: one sentence.
        find: instances, from the episodes and the reordered indices of the null distribution (None: as they are).
        null: what the null distribution reorders.
        missing: part that the task lacks, so that the behaviour is not counted; empty if it lacks none.
    """

    name: str
    definition: str
    find: Callable[[Motion, Array | None], list[Event]]
    null: NullMethod
    missing: str = ""


def without_strategies(task: PairTask) -> str:
    """The part that a task lacks for disagreement and adaptation; empty if it lacks none."""
    undefined = type(task.studies).strategy_actions is Studies.strategy_actions
    return "actions of each strategy (`studies.strategy_actions`)" if undefined else ""


def behaviours_of(task: PairTask) -> list[Behaviour]:
    """All behaviours, in the order of tables; those that the task does not define have a `missing` part."""
    robot, human = task.spec.players
    figures = task.studies.figures
    levels = figures.thresholds if figures is not None and task.offers("interaction") else ()
    no_strategy = without_strategies(task)
    prefer = (
        f"A player prefers the strategy that its action (mean over {adaptation.SMOOTHING_S:g} s) follows by "
        f"{adaptation.MARGIN:g} of a full action more than any other within reach."
    )
    return [
        Behaviour(
            "disagreement",
            f"The players prefer different strategies for at least {adaptation.SHORTEST_S:g} s. {prefer}",
            adaptation.disagreements,
            "shift",
            no_strategy,
        ),
        Behaviour(
            "adaptation",
            f"A disagreement after which, within {adaptation.WITHIN_S:g} s, both prefer the same strategy for at least "
            f"{adaptation.SHORTEST_S:g} s; whoever preferred another one before gave way.",
            adaptation.adaptations,
            "shift",
            no_strategy,
        ),
        Behaviour(
            "leadership_switch",
            "The player whose actions precede the partner's (windowed cross-correlation, as in the statistics of data "
            f"sets) changes between two times of at least {leadership.STEADY_S:g} s with the same leader each.",
            leadership.leadership_switches,
            "shift",
        ),
        *(
            Behaviour(
                f"passivity_{name}",
                f"The {name} applies less than {MIN_EFFORT:g} of a full force and the other player at least that, for "
                f"{forces.PASSIVE_S:g} s or more.",
                functools.partial(forces.passivity, seat=seat),
                "shift",
            )
            for seat, name in enumerate((robot, human))
        ),
        Behaviour(
            "pivot",
            f"The {task.words.noun} turns by at least {math.degrees(pivot.TURN):.0f} degrees, at {pivot.SPIN:g} rad/s "
            f"or more, one end at most {pivot.HAND_SPEEDS:g} times as fast as the other, within half the distance of "
            "its ends from an obstacle.",
            pivot.pivots,
            "obstacles",
            "" if task.outline is not None else "outline",
        ),
        *(
            Behaviour(
                f"dissent_{level:g}" if levels else "dissent",
                f"The interaction measure is at least {level:g} for at least {forces.DISSENT_S:g} s.",
                functools.partial(forces.dissent, level=level),
                "shift",
                "" if levels else "thresholds of its interaction measure (`studies.figures`)",
            )
            for level in levels or (math.nan,)
        ),
    ]
