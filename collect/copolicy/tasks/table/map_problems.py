"""Checks of maps: parts outside the window or inside each other, a goal out of reach, the same map twice."""

import functools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from copolicy.dataset.arrays import Array

from .agents import grid
from .agents.clearance import square_clearance, wall_clearance
from .map_config import WINDOW, MapConfig
from .physics import GOAL_SIZE
from .world import TableWorld

PathMessage = tuple[str, str]
"""Path in the file, such as `maps[0].goal`, and what is wrong there."""

_Squares = tuple[tuple[tuple[float, float], int], ...]


def map_problems(maps: Sequence[Sequence[MapConfig]]) -> Iterator[PathMessage]:
    """Yields what is wrong with the maps of a file.

    Args:
        maps: each in all its orientations.
    """
    first_index: dict[str, int] = {}  # by digest
    for index, turned in enumerate(maps):
        path = f"maps[{index}]"
        problems = dict.fromkeys(problem for config in turned for problem in _problems(config))
        yield from ((f"{path}{part}", message) for part, message in problems)
        repeated = sorted({first_index.setdefault(config.digest, index) for config in turned} - {index})
        if repeated:
            yield path, f"the same as maps[{repeated[0]}]"


def _problems(config: MapConfig) -> list[PathMessage]:
    """Problems of one map; whether the goal can be reached is checked only where there is no other problem."""
    problems: list[PathMessage] = []
    for index, (centre, size) in enumerate(config.squares):
        if not _inside(centre, size):
            problems.append((f".obstacles[{index}]", f"{_square(centre, size)} lies outside the window of {_WINDOW}"))
        if centre in config.obstacles[:index]:
            problems.append((f".obstacles[{index}]", f"same centre as obstacles[{config.obstacles.index(centre)}]"))
    if not _inside(config.goal, GOAL_SIZE):
        problems.append((".goal", f"{_square(config.goal, GOAL_SIZE)} lies outside the window of {_WINDOW}"))
    contact = TableWorld(config).contact(config.start)
    x, y, theta = config.start
    start = f"the table at ({x:g}, {y:g}), {np.degrees(theta):.0f} degrees,"
    for touched, message in (
        (contact.wall, f"reaches out of the window of {_WINDOW}"), (contact.obstacle, "starts inside an obstacle"),
        (contact.goal, "touches the goal at its start"),
    ):  # fmt: skip
        if touched:
            problems.append((".start", f"{start} {message}"))
    if not problems and not _reachable(config):
        problems.append((".goal", "out of reach: the table cannot pass the obstacles on any path from the start"))
    return problems


_WINDOW = f"{WINDOW[0]} x {WINDOW[1]} px"


def _square(centre: tuple[float, float], size: int) -> str:
    return f"the square of {size} px at ({centre[0]:g}, {centre[1]:g})"


def _inside(centre: tuple[float, float], size: float) -> bool:
    return all(size / 2 <= value <= side - size / 2 for value, side in zip(centre, WINDOW, strict=True))


def _reachable(config: MapConfig) -> bool:
    """Whether a pose next to the start and one that touches the goal are connected on the grid of poses."""
    parts = _parts(config.layout)
    touching = square_clearance(*grid.poses(), config.goal, GOAL_SIZE).ravel() <= 0
    goals = set(parts[touching & (parts >= 0)].tolist())
    x, y, theta = config.start
    turn = np.pi / grid.ANGLES
    near = {
        int(parts[grid.cell(x + right * grid.CELL, y + down * grid.CELL, theta + around * turn)])
        for right in (-1, 0, 1) for down in (-1, 0, 1) for around in (-1, 0, 1)
    }  # fmt: skip
    return bool(goals & near - {-1})


@functools.lru_cache(maxsize=64)
def _parts(squares: _Squares) -> Array:
    """`(COUNT,)` number of the connected component of each cell of the grid, -1 where the table is in contact."""
    x, y, theta = grid.poses()
    free = np.broadcast_to(wall_clearance(x, y, theta) > 0, grid.SHAPE)
    for centre, size in squares:
        free = free & (square_clearance(x, y, theta, centre, size) > 0)
    # The first angle is repeated after the last one, since the grid is periodic in half a turn.
    labels = np.empty((grid.ANGLES + 1, grid.ROWS, grid.COLUMNS), np.int32)
    label(np.concatenate((free, free[:1])), np.ones((3, 3, 3)), output=labels)
    count = int(labels.max())
    ends = labels[0][free[0]], labels[-1][free[0]]
    graph = csr_matrix((np.ones(len(ends[0]), np.int64), ends), shape=(count + 1, count + 1))
    parts = connected_components(graph, directed=False)[1][labels[:-1]]
    return np.where(free, parts, -1).ravel()
