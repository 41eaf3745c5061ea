"""Cost-to-go of every pose for each route to the goal, and the next target pose (Dijkstra on the grid of poses).

A px of path costs more near obstacles and walls. A route is enforced by fences: a line from each obstacle to the edge
of the window, on the side where the table must not pass, which is expensive to cross.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError

from ..map_config import MapConfig
from ..physics import GOAL_SIZE
from . import grid
from .clearance import square_clearance, wall_clearance

LOOKAHEAD = 4
"""Cells between a pose and the target pose of a scripted player."""

_TIGHT = 7.0  # px from obstacles, for clearance 1: below it the cost is _CLOSE_COST
_WIDE = 38.0  # px from obstacles, for clearance 1: beyond it there is no extra cost
# px, the same for walls, for every clearance; chosen so that the routes between two obstacles are taken as often as
# people take them (Yang and Mavrogiannis' labels of the human demonstrations).
_WALL_TIGHT, _WALL_WIDE = 10.0, 65.0
_NEAR_COST = 4.0  # extra cost of a px of path at the tight distance
_CLOSE_COST = 30.0  # extra cost of a px of path below it
_BARRIER = 4000.0  # px; longer than any path, but finite, so that a player on the wrong side still has a path


class Route(NamedTuple):
    """The paths that pass each obstacle on a given side.

    Attributes:
        sides: one letter an obstacle, R where it stays on the right of the path and L on the left; letters and
            their order are those of `copolicy.tasks.table.routes.route_class`.
        cost: `(COUNT,)` cost-to-go of each cell, px of free path.
        ahead: `(COUNT,)` index of the target cell, `LOOKAHEAD` cells ahead.
    """

    sides: str
    cost: Array
    ahead: Array


def routes(config: MapConfig, clearance: float) -> tuple[Route, ...]:
    """All routes of a map; cached for maps that differ only in their start or the order of their obstacles.

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
    cost_per_px, free = _cost_per_px(obstacles, clearance)
    moves = grid.moves()
    weight = moves.length * (cost_per_px[moves.source] + cost_per_px[moves.target]) * 0.5
    touching = (square_clearance(*grid.poses(), goal, GOAL_SIZE).ravel() <= 0) & free
    goals = np.flatnonzero(touching)
    if not len(goals):
        centres = tuple(centre for centre, _ in obstacles)
        raise InvalidValueError("map", "a goal that the table can touch", (goal, centres))
    all_routes = []
    for sides in itertools.product("LR", repeat=len(obstacles)):
        fenced = weight.copy()
        for (centre, _), side in zip(obstacles, sides, strict=True):
            fenced[_fence(centre, axis, (forward if side == "R" else -forward) * (1 if axis == 0 else -1))] += _BARRIER
        graph = csr_matrix((fenced, moves.target, moves.pointer), shape=(grid.COUNT, grid.COUNT))
        cost, successor, _ = dijkstra(graph, indices=goals, min_only=True, return_predecessors=True)
        successor = np.where(successor < 0, np.arange(grid.COUNT), successor).astype(np.int32)
        ahead = successor
        for _ in range(LOOKAHEAD - 1):
            ahead = successor[ahead]
        all_routes.append(Route("".join(sides), cost.astype(np.float32), ahead))
    return tuple(all_routes)


def _cost_per_px(obstacles, clearance: float) -> tuple[Array, Array]:
    """Cost of a px of path in each cell `(COUNT,)`, and in which cells the table touches nothing `(COUNT,)`."""
    x, y, theta = grid.poses()
    tight = _TIGHT * clearance
    space = wall_clearance(x, y, theta)
    extra = _extra_cost(space, _WALL_TIGHT, _WALL_WIDE)
    free = space > 0
    for centre, size in obstacles:
        space = square_clearance(x, y, theta, centre, size)
        extra = np.maximum(extra, _extra_cost(space, tight, _WIDE * clearance))
        free = free & (space > 0)
    return (1.0 + extra).ravel(), free.ravel()


def _extra_cost(space: Array, tight: float, wide: float) -> Array:
    near = np.clip((wide - space) / (wide - tight), 0.0, 1.0)
    return np.where(space < tight, _CLOSE_COST, _NEAR_COST * near**2)


@functools.lru_cache(maxsize=64)
def _fence(centre: tuple[float, float], axis: int, side: int) -> Array:
    """Moves that cross the line from an obstacle to the edge of the window, at a right angle to the path's axis."""
    moves = grid.moves()
    across = np.broadcast_to(grid.poses()[axis], grid.SHAPE).ravel()
    along = np.broadcast_to(grid.poses()[1 - axis], grid.SHAPE).ravel()
    near = np.abs(across - centre[axis]) <= grid.REACH * grid.CELL
    candidates = np.flatnonzero(near[moves.source])
    source, target = moves.source[candidates], moves.target[candidates]
    crosses = (across[source] < centre[axis]) != (across[target] < centre[axis])
    middle = (along[source] + along[target]) / 2
    return candidates[crosses & ((middle - centre[1 - axis]) * side > 0)]
