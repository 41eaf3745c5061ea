"""Which configurations of start, goal and obstacles a study with partners uses."""

import math
from itertools import islice
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import get_task

MAPS, USUAL = "unseen", 60
"""The set of maps that studies with a partner take, and how many starts: as many as the paper has."""

_STRIDE = 37


def study_configurations(maps: str | ScenarioSet, count: int | None = None) -> tuple[Any, ...]:
    """`count / 4` maps of a set, each with the four start orientations 0, pi/2, pi and 3 pi/2.

    The paper has 60 configurations and four orientations, and publishes no list. Ours are the maps 0, 37, 74, ...
    of the set, counted around its end: 37 shares no factor with the 84 maps of a set, with their 12 pairs of start
    and goal or with their 7 sets of obstacles, so that each of these comes up equally often (to one more or less).
    A map that the set repeats counts once. A task without orientations has `count` maps.

    Args:
        maps: a set, or what `--maps` says of the table.
        count: `USUAL`, or all of a smaller set, if None.

    Raises:
        UnknownNameError: no such set.
        InvalidValueError: a number that is no multiple of the orientations, or more than the set has.
    """
    chosen = get_task().scenario_set(maps) if isinstance(maps, str) else maps
    turns = get_task(chosen.task).orientations
    turned = all_starts(chosen)
    bases = turned[::turns]
    stride = next(s for s in range(_STRIDE, _STRIDE + len(bases) + 1) if math.gcd(s, len(bases)) == 1)
    strided = (bases[k * stride % len(bases)] for k in range(len(bases)))
    distinct = list({config.digest: config for config in strided}.values())
    most = turns * len(distinct)
    count = min(USUAL, most) if count is None else count
    if count < turns or count % turns or count > most:
        expected = f"a multiple of {turns} from {turns} to {most}" if turns > 1 else f"1 to {most}"
        raise InvalidValueError("--configurations", expected, count)
    wanted = {config.digest for config in islice(distinct, count // turns)}
    places = {config.digest: k for k, config in enumerate(bases)}
    order = sorted(places[digest] for digest in wanted)
    return tuple(turned[turns * place + k] for place in order for k in range(turns))


def all_starts(chosen: ScenarioSet) -> tuple[Any, ...]:
    """The scenarios of a set, each with every start orientation that its task has."""
    task = get_task(chosen.task)
    return (task.turned(chosen) if task.orientations > 1 else chosen).scenarios
