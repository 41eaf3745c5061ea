"""The forces with which each player would follow each route, to recognise from forces which route a player prefers."""

import math

import numpy as np

from copolicy.dataset.arrays import Array

from ..features import theta_of
from ..map_config import MapConfig
from ..physics import Physics
from . import grid
from .cost_to_go import routes
from .profiles import PlayerProfile
from .route_choice import DETOUR, heading
from .scripted_player import MAX_SPIN, TURN_GAIN, spin_per_force


def route_forces(scenario: MapConfig, states: Array) -> tuple[tuple[str, ...], Array]:
    """Forces of each player that move the table along each route at a steady speed, and turn it as the route asks.

    The routes and their costs are those of the scripted players, with the clearance that people keep.

    Args:
        states: `(T, 7)` of the table.

    Returns:
        Route classes of all routes. `(T, 2, R, 2)` force x, y of the robot's and the human's end for each, of a full
        force; NaN where a route is longer than the shortest one by more than 250 px, as after its obstacle.
    """
    profile, physics = PlayerProfile(), Physics()
    choices = routes(scenario, profile.clearance)
    cruise = profile.speed * physics.linear_damping / physics.force_scale  # joint force at a steady speed
    spin = spin_per_force(physics)
    forces = np.full((len(states), 2, len(choices), 2), np.nan)
    for step, (x, y, theta) in enumerate(zip(*states[:, :2].T.tolist(), theta_of(states).tolist(), strict=True)):
        cell = grid.cell(x, y, theta)
        costs = [float(route.cost[cell]) for route in choices]
        limit = min(costs) + DETOUR
        for index, (route, cost) in enumerate(zip(choices, costs, strict=True)):
            if cost > limit:
                continue
            dx, dy, turn = heading(route, (x, y, theta), scenario.goal)
            distance = math.hypot(dx, dy) + 1e-9
            across = min(MAX_SPIN, max(-MAX_SPIN, TURN_GAIN * turn)) / spin
            # Half of the joint force each; the two ends turn the table by opposite forces across it.
            along_x, along_y = cruise * dx / distance / 2, cruise * dy / distance / 2
            across_x, across_y = across / 2 * math.sin(theta), across / 2 * math.cos(theta)
            forces[step, :, index] = (along_x - across_x, along_y - across_y), (along_x + across_x, along_y + across_y)
    return tuple(route.sides for route in choices), forces
