"""The map sets: the training family, the paper's 36 configurations, the two evaluation lists, and varied layouts.

Sources: `rnd_obstacle_v2.yml`, `varied_maps_test_holdout.yml` and `varied_maps_unseen_map.yml` of the
original program, as positions in fractions of the window; the varied layouts are ours.
"""

import functools
import math
import random
import re
from dataclasses import replace
from itertools import combinations, permutations
from typing import Any

from copolicy.dataset.exceptions import UnknownNameError
from copolicy.dataset.scenarios import ScenarioSet

from .map_config import WINDOW, MapConfig

_STARTS = ((0.2, 0.2), (0.2, 0.4), (0.2, 0.6), (0.2, 0.8))
_START_THETA = 3.14  # not pi: the original's number
_GOALS = ((0.8, 0.3), (0.8, 0.5), (0.8, 0.7))
_FAMILY = ((0.4, 0.5), (0.6, 0.3), (0.6, 0.7))
_SUBSETS = tuple(subset for size in (1, 2, 3) for subset in combinations(range(3), size))
_UNSEEN = (
    ((0.5, 0.5),),
    ((0.5, 0.5), (0.55, 0.5), (0.6, 0.5)),
    ((0.5, 0.1), (0.5, 0.5), (0.5, 0.9)),
    ((0.5, 0.3), (0.5, 0.7)),
    ((0.5, 0.8), (0.5, 0.5)),
    ((0.5, 0.2), (0.5, 0.5)),
    ((0.6, 0.5), (0.4, 0.3), (0.4, 0.7)),
)
# Obstacles of the family in each of the 84 holdout maps, seven draws for each start and goal.
# The original draws them in each run from a generator that its environment shares, so that the draws differ between
# methods; this list is one such draw (seed 88), fixed, repeats included.
_HOLDOUT = (
    "01 2 2 012 0 2 2 1 12 1 0 10 0 02 0 2 102 120 012 02 1 20 0 201 10 10 21 120 12 210 01 01 02 01 210 012 1 021 "
    "10 102 120 2 21 1 021 0 102 210 2 012 12 12 210 102 1 2 12 21 0 02 0 210 102 01 021 102 201 02 1 210 01 10 20 "
    "0 02 1 0 120 210 0 1 20 12 10"
).split()
_ANGLE = re.compile(r"-\d+deg$")
ORIENTATIONS = (0.0, math.pi / 2, math.pi, 3 * math.pi / 2)
"""Start orientations of the paper's studies with people, rad."""


def _pixels(fraction: tuple[float, float]) -> tuple[float, float]:
    return (fraction[0] * WINDOW[0], fraction[1] * WINDOW[1])


def _map(start: int, goal: int, obstacles, size: int) -> MapConfig:
    return MapConfig(
        (*_pixels(_STARTS[start]), _START_THETA), _pixels(_GOALS[goal]), tuple(map(_pixels, obstacles)), size
    )


def _family(indices) -> tuple[tuple[float, float], ...]:
    return tuple(_FAMILY[int(index)] for index in indices)


def _random_layouts(count: int, seed: int) -> tuple[MapConfig, ...]:
    """Maps with random start, goal and one to three obstacles of 50 px between them that do not overlap."""
    draw = random.Random(seed)  # its sequence is the same in every version of Python
    layouts = []
    for _ in range(count):
        start, goal = draw.uniform(100, 500), draw.uniform(150, 450)
        obstacle_count, obstacles = 1 + int(3 * draw.random()), []
        while len(obstacles) < obstacle_count:
            x, y = draw.uniform(400, 800), draw.uniform(50, 550)
            if all(max(abs(x - other_x), abs(y - other_y)) > 50 for other_x, other_y in obstacles):
                obstacles.append((round(x, 1), round(y, 1)))
        layouts.append(MapConfig((240.0, round(start, 1), _START_THETA), (960.0, round(goal, 1)), tuple(obstacles), 50))
    return tuple(layouts)


_START_GOALS = tuple((start, goal) for start in range(4) for goal in range(3))

MAP_SETS: dict[str, tuple[MapConfig, ...]] = {
    # All maps of the original recording program: 4 starts x 3 goals x 7 sets of obstacles.
    "training": tuple(_map(s, g, _family(subset), 50) for s, g in _START_GOALS for subset in _SUBSETS),
    # "36 configurations": 4 starts, 3 goals, and 1, 2 or 3 obstacles. The recording program draws one of the three sets
    # of 1 or of 2 obstacles in each episode, so each configuration has three entries here (the only set of 3 obstacles
    # is repeated): equal numbers of episodes for each entry are equal numbers for each configuration.
    "paper36": tuple(
        _map(s, g, _family(subset), 50)
        for s, g in _START_GOALS
        for size in (1, 2, 3)
        for subset in (*combinations(range(3), size),) * (3 if size == 3 else 1)
    ),
    # The same with every order of the obstacles, as the recording program draws the order too: six entries for each
    # configuration. A policy that reads the obstacles as a list learns from these alone that their order says nothing.
    "paper36-orders": tuple(
        _map(s, g, _family(order), 50)
        for s, g in _START_GOALS
        for size in (1, 2, 3)
        for order in (*permutations(range(3), size),) * (2 if size == 1 else 1)
    ),
    "holdout": tuple(_map(*_START_GOALS[i // 7], _family(draw), 45) for i, draw in enumerate(_HOLDOUT)),
    "unseen": tuple(_map(s, g, layout, 45) for s, g in _START_GOALS for layout in _UNSEEN),
}
# For training on arbitrary layouts: the paper's configurations and as many random layouts.
MAP_SETS["varied"] = (*MAP_SETS["paper36"] * 5, *_random_layouts(540, seed=36))

ORIGINAL_MAPS = tuple(config for name in ("training", "holdout", "unseen") for config in MAP_SETS[name])
"""All maps of the original program."""


@functools.cache
def map_set(name: str, orientations: bool = False) -> tuple[MapConfig, ...]:
    """The maps of a set; with `orientations`, each with the four start orientations 0, pi/2, pi and 3 pi/2.

    Raises:
        UnknownNameError: no such set.
    """
    if name not in MAP_SETS:
        raise UnknownNameError("map set", name, MAP_SETS)
    maps = MAP_SETS[name]
    if not orientations:
        return maps
    return tuple(turned for config in maps for turned in _orientations(config))


def identify(config: MapConfig) -> tuple[str, str]:
    """Name of a map and of its set; the order of the obstacles does not matter.

    Returns:
        `("training-17", "training")` for a map of a set (of a repeated map, its first name; of a map of the paper's
        36, its name in the training family), `("training-17-90deg", "training")` for one of its start orientations,
        the name in its file for a map of a file, `("custom-1a2b3c4d", "custom")` for any other.
    """
    if config.named is not None:
        return config.named[:2]
    name = _names().get(config.digest)
    return (name, name.split("-")[0]) if name else (f"custom-{config.digest}", "custom")


@functools.cache
def _names() -> dict[str, str]:
    names: dict[str, str] = {}
    for set_name, maps in MAP_SETS.items():
        for index, config in enumerate(maps):
            name = f"{set_name}-{index:02d}"
            names.setdefault(config.digest, name)
            for turned in _orientations(config):
                names.setdefault(turned.digest, f"{name}-{round(math.degrees(turned.start[2]))}deg")
    return names


def turned(map_set: ScenarioSet) -> ScenarioSet:
    """A set with each map in the four start orientations, which replace the orientations that a map file gives."""
    bases: dict[Any, tuple[MapConfig, int]] = {}
    for index, (config, weight) in enumerate(zip(map_set.scenarios, map_set.weights, strict=True)):
        bases.setdefault(index if config.named is None else _ANGLE.sub("", config.named.scenario), (config, weight))
    scenarios = tuple(turned for config, _ in bases.values() for turned in _orientations(config))
    weights = tuple(weight for _, weight in bases.values() for _ in ORIENTATIONS)
    return replace(map_set, scenarios=scenarios, weights=weights)


def start_at(config: MapConfig, theta: float) -> MapConfig:
    """A map with another start orientation (rad), which is added to a name from a file in degrees."""
    name = config.named
    if name is not None:
        base = _ANGLE.sub("", name.scenario)
        name = name._replace(scenario=f"{base}-{round(math.degrees(theta)) % 360}deg")
    return replace(config, start=(*config.start[:2], theta), named=name)


def _orientations(config: MapConfig) -> list[MapConfig]:
    return [start_at(config, theta) for theta in ORIENTATIONS]
