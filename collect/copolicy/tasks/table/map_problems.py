"""What is wrong with maps: something outside or inside something else, a goal out of reach, the same map twice."""

import functools
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from .agents import grid
from .agents.clearance import square_clearance, wall_clearance
from .map_config import WINDOW, MapConfig
from .physics import GOAL_SIZE
from .world import TableWorld

Found = tuple[str, str]
"""A place in the file, and what is wrong there."""

_Squares = tuple[tuple[tuple[float, float], int], ...]


def map_problems(maps: Sequence[Sequence[MapConfig]]) -> Iterator[Found]:
    """What is wrong with the maps of a file.

    Args:
        maps: each in all its orientations.
    """
    seen: dict[str, int] = {}
    for index, own in enumerate(maps):
        place = f"maps[{index}]"
        found = list(dict.fromkeys(one for config in own for one in _of_map(config)))
        yield from ((f"{place}{part}", message) for part, message in found)
        same = sorted({seen.setdefault(config.digest, index) for config in own} - {index})
        if same:
            yield place, f"the same as maps[{same[0]}]"


def _of_map(config: MapConfig) -> list[Found]:
    """What is wrong with one map; whether the goal can be reached is asked where nothing else is wrong."""
    found: list[Found] = []
    for index, (centre, size) in enumerate(config.squares):
        if not _inside(centre, size):
            found.append((f".obstacles[{index}]", f"{_square(centre, size)} lies outside the window of {_WINDOW}"))
        if centre in config.obstacles[:index]:
            found.append((f".obstacles[{index}]", f"the place of obstacles[{config.obstacles.index(centre)}] too"))
    if not _inside(config.goal, GOAL_SIZE):
        found.append((".goal", f"{_square(config.goal, GOAL_SIZE)} lies outside the window of {_WINDOW}"))
    contact = TableWorld(config).contact(config.start)
    x, y, theta = config.start
    start = f"the table at ({x:g}, {y:g}), {np.degrees(theta):.0f} degrees,"
    for touched, what in (
        (contact.wall, f"reaches out of the window of {_WINDOW}"), (contact.obstacle, "starts inside an obstacle"),
        (contact.goal, "touches the goal at its start"),
    ):  # fmt: skip
        if touched:
            found.append((".start", f"{start} {what}"))
    if not found and not _reachable(config):
        found.append((".goal", "out of reach: no way for a table of this length from the start past the obstacles"))
    return found


_WINDOW = f"{WINDOW[0]} x {WINDOW[1]} px"


def _square(centre: tuple[float, float], size: int) -> str:
    return f"the square of {size} px at ({centre[0]:g}, {centre[1]:g})"


def _inside(centre: tuple[float, float], size: float) -> bool:
    return all(size / 2 <= value <= side - size / 2 for value, side in zip(centre, WINDOW, strict=True))


def _reachable(config: MapConfig) -> bool:
    """Whether a pose beside the start and one that touches the goal hang together on the planner's grid."""
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
def _parts(squares: _Squares) -> np.ndarray:
    """`(COUNT,)` number of the connected part that each cell of the grid lies in, -1 where the table touches."""
    x, y, theta = grid.poses()
    free = np.broadcast_to(wall_clearance(x, y, theta) > 0, grid.SHAPE)
    for centre, size in squares:
        free = free & (square_clearance(x, y, theta, centre, size) > 0)
    # The first angle once more behind the last one, since half a turn on the table lies as at the first.
    labels = np.empty((grid.ANGLES + 1, grid.ROWS, grid.COLUMNS), np.int32)
    label(np.concatenate((free, free[:1])), np.ones((3, 3, 3)), output=labels)
    count = int(labels.max())
    ends = labels[0][free[0]], labels[-1][free[0]]
    graph = csr_matrix((np.ones(len(ends[0]), np.int64), ends), shape=(count + 1, count + 1))
    parts = connected_components(graph, directed=False)[1][labels[:-1]]
    return np.where(free, parts, -1).ravel()
