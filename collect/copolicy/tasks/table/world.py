"""The world of the table: its dynamics under two forces, and its contacts."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymunk

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.task import RUNNING, Outcome

from .features import state_vector
from .geometry import IMAGE_SIZE, PART_BOUNDS, REACH, drawn_centre, image_size
from .map_config import WINDOW, MapConfig
from .physics import GOAL_SIZE, Physics
from .reward import reward
from .solids import square_shape, table_shapes

Triple = tuple[float, float, float]

_TURN = 2 * math.pi
_WIDTH, _HEIGHT = WINDOW
# The table is drawn up to one pixel away from its position.
_SLACK = 1.0
_NEAR = REACH + _SLACK
_HALF_DIAGONAL = math.hypot(*IMAGE_SIZE) / 2 + _SLACK


class Contact(NamedTuple):
    """Whether the table at a pose touches an obstacle or the goal, or leaves the window (`wall`)."""

    obstacle: bool
    goal: bool
    wall: bool


_NO_CONTACT = Contact(False, False, False)
_GOAL = Outcome(True, True, "goal")
_OBSTACLE = Outcome(True, False, "collision_obstacle")
_WALL = Outcome(True, False, "collision_wall")
_TIMEOUT = Outcome(True, False, "timeout")


class TableWorld:
    """A table under two forces in a window of 1200 x 600 px, in steps of 1/30 s.

    The dynamics are those of the original program, in the same order: position to second order and velocity to first
    order, from the velocity before the step; the bound on the angular acceleration includes the damping. An episode
    ends when the table touches the goal (a success even if it touches an obstacle too), else when it touches an
    obstacle, else when the box of the rotated image leaves the window, else at the step limit. `step` may be called
    after an end; the caller decides when to stop.

    Contacts are pymunk shape queries. The original compares pixels of rotated images; where the two disagree, the
    table is within a pixel of contact (see tests/test_world.py for the rate).

    Attributes:
        map_config: the map.
        physics: settings of the dynamics.
        pose: (x, y, theta) in px and rad, theta in [0, 2 pi).
        velocity: (vx, vy, omega) in px/s and rad/s.
        step_count: steps since the last reset.
    """

    def __init__(self, map_config: MapConfig, physics: Physics | None = None):
        self.map_config = map_config
        self.physics = physics = physics or Physics()
        self._dt = physics.dt
        self._damping = -physics.linear_damping / physics.mass
        self._push = physics.force_scale / physics.mass
        self._spin_damping = -physics.angular_damping / physics.inertia
        self._twist = physics.lever / 2 * physics.force_scale / physics.inertia
        self._limit = physics.angular_acceleration_limit
        self._step_limit = physics.step_limit

        self._space = pymunk.Space()
        self._table = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        self._parts = tuple(zip(table_shapes(self._table), PART_BOUNDS, strict=True))
        solids = [*map_config.squares, (map_config.goal, GOAL_SIZE)]
        shapes = [square_shape(self._space.static_body, centre, size) for centre, size in solids]
        self._space.add(self._table, *shapes)
        self._goal_shape = shapes[-1]
        self._solids = tuple((x, y, size / 2 + _SLACK) for (x, y), size in solids)
        self.reset()

    def reset(self, pose: Sequence[float] | None = None, velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        """Puts the table at a pose, by default at rest at the map's start, and sets the step count to zero.

        Raises:
            InvalidValueError: a pose or velocity that is not three finite numbers.
        """
        x, y, theta = _triple("pose", self.map_config.start if pose is None else pose)
        self.pose: Triple = (x, y, theta % _TURN)
        self.velocity: Triple = _triple("velocity", velocity)
        self.step_count = 0
        self._cos, self._sin = math.cos(theta), math.sin(theta)

    @property
    def recorded(self) -> tuple[float, ...]:
        """The exact state: x, y, theta, vx, vy, omega (px, rad, px/s, rad/s)."""
        return (*self.pose, *self.velocity)

    def restore(self, recorded: Sequence[float]) -> None:
        """Puts the table into a recorded state, and sets the step count to zero."""
        self.reset(recorded[:3], recorded[3:])

    @property
    def observation(self) -> Array:
        """`(7,)` x, y, cos_theta, sin_theta, vx, vy, omega (px, px/s, rad/s)."""
        return state_vector(self.pose, self.velocity)

    def step(self, action: Array | Sequence[float]) -> Outcome:
        """Advances by 1/30 s under `action` `(4,)`: robot xy, human xy, each clipped to [-1, 1].

        Raises:
            ShapeError: an action of another shape.
            InvalidValueError: an action that is not finite.
        """
        u1x, u1y, u2x, u2y = _forces(action)
        x, y, theta = self.pose
        vx, vy, omega = self.velocity
        dt = self._dt
        ax = self._damping * vx + self._push * (u1x + u2x)
        ay = self._damping * vy + self._push * (u1y + u2y)
        torque = self._twist * (self._sin * (u2x - u1x) + self._cos * (u2y - u1y))
        alpha = self._spin_damping * omega + torque
        limit = self._limit
        if alpha > limit:
            alpha = limit
        elif alpha < -limit:
            alpha = -limit
        half = 0.5 * dt * dt
        x += vx * dt + ax * half
        y += vy * dt + ay * half
        theta = (theta + omega * dt + alpha * half) % _TURN
        self.pose = (x, y, theta)
        self.velocity = (vx + ax * dt, vy + ay * dt, omega + alpha * dt)
        self._cos, self._sin = cos, sin = math.cos(theta), math.sin(theta)
        self.step_count += 1

        obstacle, goal, wall = self._contact(x, y, theta, cos, sin)
        if goal:
            return _GOAL
        if obstacle:
            return _OBSTACLE
        if wall:
            return _WALL
        return _TIMEOUT if self.step_count >= self._step_limit else RUNNING

    def contact(self, pose: Sequence[float]) -> Contact:
        """Contacts of the table at a pose (x, y, theta), px and rad; does not change the world."""
        x, y, theta = _triple("pose", pose)
        return self._contact(x, y, theta, math.cos(theta), math.sin(theta))

    def reward(self) -> float:
        """Reward at the present pose; see `copolicy.tasks.table.reward`."""
        return reward(self.pose[0], self.pose[1], self.map_config)

    def _contact(self, x: float, y: float, theta: float, cos: float, sin: float) -> Contact:
        # In most steps the table is far from all solids; distances from its centre decide these without a shape query.
        close = []
        for solid in self._solids:
            dx, dy, half = abs(x - solid[0]), abs(y - solid[1]), solid[2]
            if dx - half < _NEAR and dy - half < _NEAR:
                close.append(solid)
        inside = _HALF_DIAGONAL < x < _WIDTH - _HALF_DIAGONAL and _HALF_DIAGONAL < y < _HEIGHT - _HALF_DIAGONAL
        if inside and not close:
            return _NO_CONTACT
        width, height = image_size(cos, sin)
        obstacle = goal = False
        if close:
            placed = False
            for shape, (u, v, radius) in self._parts:
                part_x, part_y = x + u * cos + v * sin, y - u * sin + v * cos
                for solid_x, solid_y, half in close:
                    gap = half + radius
                    if abs(part_x - solid_x) < gap and abs(part_y - solid_y) < gap:
                        break
                else:
                    continue
                if not placed:
                    self._table.position = drawn_centre(x, y, width)
                    self._table.angle = -theta
                    placed = True
                for hit in self._space.shape_query(shape):
                    if hit.shape is self._goal_shape:
                        goal = True
                    else:
                        obstacle = True
        wall = False
        if not inside:
            left, top = int(x) - width // 2, int(y) - height // 2
            wall = left < 0 or top < 0 or left + width > _WIDTH or top + height > _HEIGHT
        return Contact(obstacle, goal, wall)


def _forces(action: Array | Sequence[float]) -> list[float]:
    try:
        array = np.asarray(action, dtype=float)
    except (TypeError, ValueError):
        raise InvalidValueError("action", "four numbers", action) from None
    if array.shape != (4,):
        raise ShapeError("action", (4,), array.shape)
    forces = array.tolist()
    for index, force in enumerate(forces):
        if not -1.0 <= force <= 1.0:
            if not math.isfinite(force):
                raise InvalidValueError("action", "finite numbers", forces)
            forces[index] = 1.0 if force > 0 else -1.0
    return forces


def _triple(name: str, values: Sequence[float]) -> Triple:
    try:
        a, b, c = (float(value) for value in values)
    except (TypeError, ValueError):
        raise InvalidValueError(name, "three numbers", values) from None
    if not (math.isfinite(a) and math.isfinite(b) and math.isfinite(c)):
        raise InvalidValueError(name, "finite numbers", (a, b, c))
    return a, b, c
