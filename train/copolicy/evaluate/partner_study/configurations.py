"""Which configurations of start, goal and obstacles a study with partners uses."""

import math
from itertools import islice

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import map_set

ORIENTATIONS = 4

_STRIDE = 37


def study_configurations(name: str, count: int) -> tuple[MapConfig, ...]:
    """`count / 4` maps of a set, each with the four start orientations 0, pi/2, pi and 3 pi/2.

    The paper has 60 configurations and four orientations, and publishes no list. Ours are the maps 0, 37, 74, ...
    of the set, counted around its end: 37 shares no factor with the 84 maps of a set, with their 12 pairs of start
    and goal or with their 7 sets of obstacles, so that each of these comes up equally often (to one more or less).
    A map that the set repeats counts once.

    Raises:
        UnknownNameError: no such set.
        InvalidValueError: a number that is no multiple of four, or more than the set has.
    """
    maps = map_set(name)
    stride = next(s for s in range(_STRIDE, _STRIDE + len(maps) + 1) if math.gcd(s, len(maps)) == 1)
    strided = (maps[k * stride % len(maps)] for k in range(len(maps)))
    distinct = list({config.digest: config for config in strided}.values())
    if count < ORIENTATIONS or count % ORIENTATIONS or count > ORIENTATIONS * len(distinct):
        most = ORIENTATIONS * len(distinct)
        raise InvalidValueError(
            "--configurations", f"a multiple of {ORIENTATIONS} from {ORIENTATIONS} to {most}", count
        )
    chosen = {config.digest: config for config in islice(distinct, count // ORIENTATIONS)}
    position = {config.digest: k for k, config in enumerate(maps)}
    order = sorted(chosen, key=lambda digest: position[digest])
    turned = map_set(name, orientations=True)
    return tuple(turned[ORIENTATIONS * position[digest] + k] for digest in order for k in range(ORIENTATIONS))
