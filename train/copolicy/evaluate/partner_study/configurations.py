"""Which configurations of start, goal and obstacles a study with partners uses."""

import math
from itertools import islice
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import get_task

ORIENTATIONS = 4

_STRIDE = 37


def study_configurations(maps: str | ScenarioSet, count: int) -> tuple[Any, ...]:
    """`count / 4` maps of a set, each with the four start orientations 0, pi/2, pi and 3 pi/2.

    The paper has 60 configurations and four orientations, and publishes no list. Ours are the maps 0, 37, 74, ...
    of the set, counted around its end: 37 shares no factor with the 84 maps of a set, with their 12 pairs of start
    and goal or with their 7 sets of obstacles, so that each of these comes up equally often (to one more or less).
    A map that the set repeats counts once.

    Args:
        maps: a set, or what `--maps` says.

    Raises:
        UnknownNameError: no such set.
        InvalidValueError: a number that is no multiple of four, or more than the set has.
    """
    task = get_task()
    turned = task.turned(task.scenario_set(maps) if isinstance(maps, str) else maps).scenarios
    bases = turned[::ORIENTATIONS]
    stride = next(s for s in range(_STRIDE, _STRIDE + len(bases) + 1) if math.gcd(s, len(bases)) == 1)
    strided = (bases[k * stride % len(bases)] for k in range(len(bases)))
    distinct = list({config.digest: config for config in strided}.values())
    if count < ORIENTATIONS or count % ORIENTATIONS or count > ORIENTATIONS * len(distinct):
        most = ORIENTATIONS * len(distinct)
        raise InvalidValueError(
            "--configurations", f"a multiple of {ORIENTATIONS} from {ORIENTATIONS} to {most}", count
        )
    chosen = {config.digest: config for config in islice(distinct, count // ORIENTATIONS)}
    position = {config.digest: k for k, config in enumerate(bases)}
    order = sorted(chosen, key=lambda digest: position[digest])
    return tuple(turned[ORIENTATIONS * position[digest] + k] for digest in order for k in range(ORIENTATIONS))
