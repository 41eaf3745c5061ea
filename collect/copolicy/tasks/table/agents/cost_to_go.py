"""Ways to the goal: for each route, the cost-to-go of every pose and the pose to head for (Dijkstra on the grid).

A px of way costs more near obstacles and walls. A route is made by fences: lines from each obstacle to the edge of
the window, on the side where the table shall not pass.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from copolicy.dataset.exceptions import InvalidValueError

from ..map_config import MapConfig
from ..physics import GOAL_SIZE
from . import grid
from .clearance import square_clearance, wall_clearance

LOOKAHEAD = 4
"""Cells between a pose and the pose that a pilot heads for."""

_TIGHT = 7.0  # px of clearance that a pilot of clearance 1 insists on ...
_WIDE = 38.0  # ... and beyond which it is at ease
# px, the same for walls, whatever the clearance; chosen so that the routes between two obstacles are taken as often
# as people take them (Yang and Mavrogiannis' labels of the human demonstrations).
_WALL_TIGHT, _WALL_WIDE = 10.0, 65.0
_UNEASE = 4.0  # extra cost of a px of way at the tight clearance
_DANGER = 30.0  # cost of a px of way below it
_BARRIER = 4000.0  # px; more than any way, finite so that a pilot on the wrong side still knows where to go


class Route(NamedTuple):
    """One way past the obstacles.

    Attributes:
        sides: one letter an obstacle, R where it is left on the right hand and L on the left hand; letters and
            their order are those of `copolicy.tasks.table.routes.route_class`.
        cost: `(COUNT,)` cost-to-go of each cell, px of free way.
        ahead: `(COUNT,)` the cell to head for.
    """

    sides: str
    cost: np.ndarray
    ahead: np.ndarray


def routes(config: MapConfig, clearance: float) -> tuple[Route, ...]:
    """All routes of a map, from a cache: maps that differ in their start or the order of obstacles share them.

    Raises:
        InvalidValueError: the goal cannot be touched without touching an obstacle or leaving the window.
    """
    ahead = (config.goal[0] - config.start[0], config.goal[1] - config.start[1])
    axis = 0 if abs(ahead[0]) >= abs(ahead[1]) else 1
    forward = 1 if ahead[axis] >= 0 else -1
    obstacles = tuple(sorted(config.squares, key=lambda square: math.atan2(square[0][1], square[0][0])))
    return _routes(config.goal, obstacles, clearance, axis, forward)


@functools.lru_cache(maxsize=48)  # 0.6 to 2.5 MB each
def _routes(goal, obstacles, clearance: float, axis: int, forward: int) -> tuple[Route, ...]:
    effort, free = _effort(obstacles, clearance)
    moves = grid.moves()
    weight = moves.length * (effort[moves.source] + effort[moves.target]) * 0.5
    touching = (square_clearance(*grid.poses(), goal, GOAL_SIZE).ravel() <= 0) & free
    goals = np.flatnonzero(touching)
    if not len(goals):
        centres = tuple(centre for centre, _ in obstacles)
        raise InvalidValueError("map", "a goal that the table can touch", (goal, centres))
    found = []
    for sides in itertools.product("LR", repeat=len(obstacles)):
        fenced = weight.copy()
        for (centre, _), side in zip(obstacles, sides, strict=True):
            fenced[_fence(centre, axis, (forward if side == "R" else -forward) * (1 if axis == 0 else -1))] += _BARRIER
        graph = csr_matrix((fenced, moves.target, moves.pointer), shape=(grid.COUNT, grid.COUNT))
        cost, following, _ = dijkstra(graph, indices=goals, min_only=True, return_predecessors=True)
        following = np.where(following < 0, np.arange(grid.COUNT), following).astype(np.int32)
        ahead = following
        for _ in range(LOOKAHEAD - 1):
            ahead = following[ahead]
        found.append(Route("".join(sides), cost.astype(np.float32), ahead))
    return tuple(found)


def _effort(obstacles, clearance: float) -> tuple[np.ndarray, np.ndarray]:
    """Cost of a px of way in each cell `(COUNT,)`, and which cells touch nothing."""
    x, y, theta = grid.poses()
    tight = _TIGHT * clearance
    space = wall_clearance(x, y, theta)
    unease = _unease(space, _WALL_TIGHT, _WALL_WIDE)
    free = space > 0
    for centre, size in obstacles:
        space = square_clearance(x, y, theta, centre, size)
        unease = np.maximum(unease, _unease(space, tight, _WIDE * clearance))
        free = free & (space > 0)
    return (1.0 + unease).ravel(), free.ravel()


def _unease(space: np.ndarray, tight: float, wide: float) -> np.ndarray:
    near = np.clip((wide - space) / (wide - tight), 0.0, 1.0)
    return np.where(space < tight, _DANGER, _UNEASE * near**2)


@functools.lru_cache(maxsize=64)
def _fence(centre: tuple[float, float], axis: int, side: int) -> np.ndarray:
    """Moves that cross the line from an obstacle to the edge of the window, across the way to the goal."""
    moves = grid.moves()
    across = np.broadcast_to(grid.poses()[axis], grid.SHAPE).ravel()
    along = np.broadcast_to(grid.poses()[1 - axis], grid.SHAPE).ravel()
    near = np.abs(across - centre[axis]) <= grid.REACH * grid.CELL
    candidates = np.flatnonzero(near[moves.source])
    source, target = moves.source[candidates], moves.target[candidates]
    crosses = (across[source] < centre[axis]) != (across[target] < centre[axis])
    middle = (along[source] + along[target]) / 2
    return candidates[crosses & ((middle - centre[1 - axis]) * side > 0)]
