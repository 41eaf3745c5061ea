"""Random maps within bounds, all with a reachable goal."""

import math
import random
from collections.abc import Mapping

from copolicy.dataset.exceptions import RunError

from .map_config import MapConfig
from .map_problems import map_problems

_TRIES = 200  # draws a map before the bounds count as too tight


def random_maps(count: int, seed: int, bounds: Mapping[str, tuple[float, float]]) -> list[MapConfig]:
    """Distinct maps that pass `map_problems` and whose obstacles do not overlap.

    Args:
        bounds: lowest and highest value by the names of `MapFiles.bounds`; px, degrees for `start_theta`, a count for
            `obstacles`.

    Raises:
        RunError: the bounds leave no room for so many maps.
    """
    draw = random.Random(seed)  # its sequence is the same in every version of Python
    maps: dict[str, MapConfig] = {}
    tries = 0
    while len(maps) < count:
        tries += 1
        if tries > _TRIES * count:
            raise RunError(f"--bounds: expected room for {count} maps, found {len(maps)} in {tries - 1} tries")
        config = _draw_map(draw, bounds)
        if config is not None and not list(map_problems([[config]])):
            maps.setdefault(config.digest, config)
    return list(maps.values())


def _draw_map(draw: random.Random, bounds: Mapping[str, tuple[float, float]]) -> MapConfig | None:
    """A random map, or None where its obstacles overlap."""

    def value(name: str) -> float:
        return round(draw.uniform(*bounds[name]), 1)

    def whole_number(name: str) -> int:
        low, high = bounds[name]
        return math.floor(draw.uniform(math.ceil(low), math.floor(high) + 1 - 1e-9))

    start = (value("start_x"), value("start_y"), round(math.radians(draw.uniform(*bounds["start_theta"])), 4))
    goal = (value("goal_x"), value("goal_y"))
    squares: list[tuple[tuple[float, float], int]] = []
    for _ in range(whole_number("obstacles")):
        centre, size = (value("obstacle_x"), value("obstacle_y")), whole_number("obstacle_size")
        for (x, y), other_size in squares:
            if max(abs(centre[0] - x), abs(centre[1] - y)) < (size + other_size) / 2:
                return None
        squares.append((centre, size))
    centres, sizes = tuple(centre for centre, _ in squares), tuple(size for _, size in squares)
    return MapConfig(start, goal, centres, obstacle_sizes=sizes)
