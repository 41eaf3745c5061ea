"""Chooses the configurations (start, goal, obstacles) of a study with partners."""

import math
from collections.abc import Sequence
from itertools import islice
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import get_task

DEFAULT_MAPS, DEFAULT_STARTS = "unseen", 60
"""Default scenario set and number of starts of studies with a partner; the paper has 60 starts."""

_STRIDE = 37


def study_configurations(maps: str | ScenarioSet, count: int | None = None) -> tuple[Any, ...]:
    """Returns `count / 4` scenarios of a set, each with the four start orientations 0, pi/2, pi and 3 pi/2.

    The paper has 60 configurations and four orientations, and publishes no list. We take the scenarios 0, 37, 74, ...
    modulo the size of the set. 37 is coprime to the 84 maps of a set, to their 12 pairs of start and goal and to their
    7 sets of obstacles, so each of these occurs equally often (within one). Duplicates in the set count once. For a
    task without orientations, `count` scenarios are returned.

    Args:
        maps: a scenario set, or the name of a set of the table.
        count: number of starts; if None `DEFAULT_STARTS`, or all of a smaller set.

    Raises:
        UnknownNameError: the set does not exist.
        InvalidValueError: `count` is no multiple of the orientations, or more than the set has.
    """
    chosen = get_task().scenario_set(maps) if isinstance(maps, str) else maps
    turns = get_task(chosen.task).orientations
    turned = all_starts(chosen)
    indices = _study_indices(turned[::turns], count, turns)
    return tuple(turned[turns * index + k] for index in indices for k in range(turns))


def front_configurations(chosen: ScenarioSet, count: int | None, fronts: Sequence[str]) -> tuple[Any, ...]:
    """Returns scenarios of a set, each in every set-up (`Studies.fronts`) in turn, chosen as by `study_configurations`.

    Args:
        count: number of starts; if None `DEFAULT_STARTS`, or all of a smaller set.

    Raises:
        InvalidValueError: `count` is no multiple of the set-ups, or more than the set has.
    """
    task = get_task(chosen.task)
    bases = all_starts(chosen)[:: task.orientations]
    indices = _study_indices(bases, count, len(fronts))
    return tuple(task.studies.with_front(bases[index], front) for index in indices for front in fronts)


def _study_indices(bases: Sequence[Any], count: int | None, turns: int) -> list[int]:
    """Sorted indices of the scenarios of a study with `count` starts, each in `turns` orientations."""
    stride = next(s for s in range(_STRIDE, _STRIDE + len(bases) + 1) if math.gcd(s, len(bases)) == 1)
    strided = (bases[k * stride % len(bases)] for k in range(len(bases)))
    distinct = list({scenario.digest: scenario for scenario in strided}.values())
    most = turns * len(distinct)
    count = min(DEFAULT_STARTS, most) if count is None else count
    if count < turns or count % turns or count > most:
        expected = f"a multiple of {turns} from {turns} to {most}" if turns > 1 else f"1 to {most}"
        raise InvalidValueError("--configurations", expected, count)
    index_of = {scenario.digest: k for k, scenario in enumerate(bases)}
    return sorted(index_of[scenario.digest] for scenario in islice(distinct, count // turns))


def all_starts(chosen: ScenarioSet) -> tuple[Any, ...]:
    """The scenarios of a set in all start orientations of its task."""
    task = get_task(chosen.task)
    return (task.turned(chosen) if task.orientations > 1 else chosen).scenarios
