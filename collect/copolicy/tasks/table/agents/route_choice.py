"""Route choice of a scripted player: it infers the partner's force from the table's motion and may change its route."""

import math

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from ..map_config import MapConfig
from ..physics import Physics
from . import grid
from .cost_to_go import Route, routes
from .profiles import PlayerProfile

_DISAGREE = 0.25  # of a full force: how much better another route must explain the partner's force
_PATIENCE_GROWTH = 1.5  # factor on the patience after each change of route
_EXCLUDED = 1000.0  # px: a route that is longer than the best one by more is never chosen at the start
_SMOOTHING_S = 0.4  # s, time constant of the estimated force
_STILL = 6.0  # px/s: below this speed the table counts as still

DETOUR = 250.0
"""A route that is longer than the shortest one by more is given up at once, px."""


def heading(route: Route, pose: tuple[float, float, float], goal: tuple[float, float]) -> tuple[float, float, float]:
    """Displacement from a pose to the next target pose of a route: x, y (px) and turn (rad)."""
    x, y, theta = pose
    cell = grid.cell(x, y, theta)
    ahead = int(route.ahead[cell])
    if ahead == cell:
        return goal[0] - x, goal[1] - y, 0.0
    ahead_x, ahead_y, ahead_theta = grid.pose(ahead)
    turn = (ahead_theta - theta + math.pi / 2) % math.pi - math.pi / 2  # either end may lead
    return ahead_x - x, ahead_y - y, turn


class PartnerForce:
    """Estimate (x, y) of the partner's force, of a full force, from the motion that the own force does not explain.

    From v' = v + (-(b/m) v + (f/m) (u_own + u_partner)) dt, solved for u_partner and smoothed over 0.4 s.
    """

    def __init__(self):
        physics = Physics()
        self._dt = physics.dt
        self._damping = physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        self._weight = physics.dt / _SMOOTHING_S
        self._velocity: tuple[float, float] | None = None
        self.x = self.y = 0.0

    def update(self, velocity: tuple[float, float], own_force: tuple[float, float]) -> None:
        """Adds a step: the table's velocity (px/s), and the own force since the previous velocity ([-1, 1])."""
        if self._velocity is not None:
            vx, vy = self._velocity
            force_x = ((velocity[0] - vx) / self._dt + self._damping * vx) / self._push - own_force[0]
            force_y = ((velocity[1] - vy) / self._dt + self._damping * vy) / self._push - own_force[1]
            # After a reset to another pose the velocity jumps by more than any force can cause.
            if math.hypot(force_x, force_y) < 2.0:
                self.x += self._weight * (force_x - self.x)
                self.y += self._weight * (force_y - self.y)
        self._velocity = velocity


class RouteChoice:
    """The route that a scripted player follows, and the rules by which it changes.

    The player changes to the route that the partner's force supports once it has done so for as long as the patience
    lasts; to the shortest route at once where the own route has become far longer; and to the shortest route when the
    table has been still for twice the patience. The only input is the table's motion.

    Attributes:
        route: the present route.
        changes: number of changes of route so far.
    """

    def __init__(self, config: MapConfig, profile: PlayerProfile, rng: np.random.Generator):
        self._rng = rng
        self._patience_s = profile.patience_s
        self._goal = config.goal
        self._routes = routes(config, profile.clearance)
        cell = grid.cell(*config.start)
        cost = np.array([route.cost[cell] - profile.left_bias * route.sides.count("L") for route in self._routes])
        cost[cost > cost.min() + _EXCLUDED] = math.inf
        odds = np.exp(-(cost - cost.min()) / profile.route_temperature)
        self.route: Route = self._routes[int(rng.choice(len(odds), p=odds / odds.sum()))]
        self.changes = 0
        self._contested = self._still = 0
        self._patience = self._draw_patience()

    def heading(self, route: Route, pose: tuple[float, float, float]) -> tuple[float, float, float]:
        """See `heading`."""
        return heading(route, pose, self._goal)

    def update(self, pose: tuple[float, float, float], speed: float, force: PartnerForce) -> None:
        """Keeps or changes the route, by pose (px, px, rad), speed (px/s) and the partner's force; once a step."""
        cell = grid.cell(*pose)
        shortest = min(self._routes, key=lambda route: route.cost[cell])
        limit = shortest.cost[cell] + DETOUR
        if self.route.cost[cell] > limit:
            self._change(shortest)
            return
        own_support = self._support(self.route, pose, force)
        best, best_support = self.route, own_support
        for route in self._routes:
            if route is not self.route and route.cost[cell] <= limit:
                support = self._support(route, pose, force)
                if support > best_support:
                    best, best_support = route, support
        contested = best_support - own_support > _DISAGREE
        self._contested = self._contested + 1 if contested else max(0, self._contested - 1)
        self._still = self._still + 1 if speed < _STILL else 0
        if self._contested > self._patience:
            self._change(best)
        elif self._still > 2 * self._patience:
            self._change(shortest)

    def _support(self, route: Route, pose: tuple[float, float, float], force: PartnerForce) -> float:
        x, y, _ = self.heading(route, pose)
        return (x * force.x + y * force.y) / (math.hypot(x, y) + 1e-9)

    def _change(self, route: Route) -> None:
        self.changes += route is not self.route
        self.route = route
        self._contested = self._still = 0
        self._patience = self._draw_patience()

    def _draw_patience(self) -> float:
        # The patience grows, since two players who change in the same step disagree once more.
        return RECORD_HZ * self._patience_s * _PATIENCE_GROWTH**self.changes * self._rng.uniform(0.5, 1.6)
