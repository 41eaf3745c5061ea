"""What a pilot makes of the table's motion: where the other one pulls, which route it wants, when it gives way."""

import math

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

from ..map_config import MapConfig
from ..physics import Physics
from . import grid
from .cost_to_go import Route, routes
from .profiles import Habits

_DISAGREE = 0.25  # of a full force: how much better another route must explain the other's pull
_DETOUR = 250.0  # px: a route that has become so much longer than another is given up at once
_FIRMER = 1.5  # times longer that it insists after each change of mind
_OUT_OF_THE_QUESTION = 1000.0  # px: no route that is so much longer is ever chosen
_MEMORY_S = 0.4  # s, how long a pull is felt
_STILL = 6.0  # px/s: the table stands


class PartnerForce:
    """The other player's force, as one player can feel it: what moves the table beyond its own push.

    From v' = v + (-(b/m) v + (f/m) (u_own + u_other)) dt, solved for u_other and smoothed over 0.4 s.
    """

    def __init__(self):
        physics = Physics()
        self._dt = physics.dt
        self._damping = physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        self._weight = physics.dt / _MEMORY_S
        self._velocity: tuple[float, float] | None = None
        self.x = self.y = 0.0

    def feel(self, velocity: tuple[float, float], own_force: tuple[float, float]) -> None:
        """Takes in the velocity of the table now, and the own force since the velocity before, px/s and [-1, 1]."""
        if self._velocity is not None:
            vx, vy = self._velocity
            pull_x = ((velocity[0] - vx) / self._dt + self._damping * vx) / self._push - own_force[0]
            pull_y = ((velocity[1] - vy) / self._dt + self._damping * vy) / self._push - own_force[1]
            # A table that is set elsewhere moves by more than any hand could move it.
            if math.hypot(pull_x, pull_y) < 2.0:
                self.x += self._weight * (pull_x - self.x)
                self.y += self._weight * (pull_y - self.y)
        self._velocity = velocity


class Intention:
    """The route that a pilot wants, and its doubts.

    It gives way when the other player has pulled towards another route for as long as its patience lasts; at once
    when the table has got to where another route is far shorter; and takes the shortest route when the table has
    stood still for twice its patience. All this it knows from the table's motion alone.

    Attributes:
        route: the route that it wants now.
        changes: how often it has changed its mind.
    """

    def __init__(self, config: MapConfig, habits: Habits, rng: np.random.Generator):
        self._rng = rng
        self._patience_s = habits.patience_s
        self._goal = config.goal
        self._routes = routes(config, habits.clearance)
        here = grid.cell(*config.start)
        wish = np.array([route.cost[here] - habits.left_bias * route.sides.count("L") for route in self._routes])
        wish[wish > wish.min() + _OUT_OF_THE_QUESTION] = math.inf
        odds = np.exp(-(wish - wish.min()) / habits.route_temperature)
        self.route: Route = self._routes[int(rng.choice(len(odds), p=odds / odds.sum()))]
        self.changes = 0
        self._contested = self._still = 0
        self._patience = self._draw_patience()

    def heading(self, route: Route, pose: tuple[float, float, float]) -> tuple[float, float, float]:
        """Way to the pose that a route heads for: x, y (px) and turn (rad)."""
        x, y, theta = pose
        here = grid.cell(x, y, theta)
        ahead = int(route.ahead[here])
        if ahead == here:
            return self._goal[0] - x, self._goal[1] - y, 0.0
        ahead_x, ahead_y, ahead_theta = grid.pose(ahead)
        turn = (ahead_theta - theta + math.pi / 2) % math.pi - math.pi / 2  # the shorter way to either end in front
        return ahead_x - x, ahead_y - y, turn

    def consider(self, pose: tuple[float, float, float], speed: float, pull: PartnerForce) -> None:
        """Weighs the route against what was felt of the other player; called once a step."""
        here = grid.cell(*pose)
        shortest = min(self._routes, key=lambda route: route.cost[here])
        limit = shortest.cost[here] + _DETOUR
        if self.route.cost[here] > limit:
            self._change(shortest)
            return
        own = self._support(self.route, pose, pull)
        best, support = self.route, own
        for route in self._routes:
            if route is not self.route and route.cost[here] <= limit:
                other = self._support(route, pose, pull)
                if other > support:
                    best, support = route, other
        self._contested = self._contested + 1 if support - own > _DISAGREE else max(0, self._contested - 1)
        self._still = self._still + 1 if speed < _STILL else 0
        if self._contested > self._patience:
            self._change(best)
        elif self._still > 2 * self._patience:
            self._change(shortest)

    def _support(self, route: Route, pose: tuple[float, float, float], pull: PartnerForce) -> float:
        x, y, _ = self.heading(route, pose)
        return (x * pull.x + y * pull.y) / (math.hypot(x, y) + 1e-9)

    def _change(self, route: Route) -> None:
        self.changes += route is not self.route
        self.route = route
        self._contested = self._still = 0
        self._patience = self._draw_patience()

    def _draw_patience(self) -> float:
        # Two players who give way in the same moment disagree again: each insists longer after every change.
        return RECORD_HZ * self._patience_s * _FIRMER**self.changes * self._rng.uniform(0.5, 1.6)
