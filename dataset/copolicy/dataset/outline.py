"""The outline of a task seen from above, in plain numbers; figures, pages and videos draw it."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from .arrays import Array

Point = tuple[float, float]
Pose = tuple[float, float, float]
"""x, y in the unit of the outline; theta in rad, counter-clockwise on screen."""


class Shape(NamedTuple):
    """A polygon. `role` is obstacle, goal or start for fixed shapes; body, robot or human for moving ones."""

    role: str
    corners: tuple[Point, ...]


class Outline(Protocol):
    """The part `outline` of a task. x points right, y down, the origin is the upper left corner.

    Attributes:
        size: width and height of the scene.
        unit: unit of lengths, `px` or `m`.
        arrow: length of the arrow that is drawn for a player's full force.
        body: shapes of the moving body in body coordinates (u, v), which equal (x, y) at the pose (0, 0, 0).
        hands: points at which the robot and the human grip the body, in body coordinates.
    """

    size: tuple[float, float]
    unit: str
    arrow: float
    body: tuple[Shape, ...]
    hands: tuple[Point, Point]

    def fixed(self, scenario: Any) -> tuple[Shape, ...]:
        """Goal, start and obstacles of a scenario, in drawing order."""
        ...

    def poses(self, states: Array) -> Array:
        """`(T, 3)` poses of the body in states `(T, n)`."""
        ...

    def forces(self, actions: Array) -> Array:
        """`(T, 4)` force arrows of joint actions `(T, 2 m)`: robot xy, human xy, of length 1 at full force."""
        ...


def to_scene(pose: Pose, point: Point) -> Point:
    """Scene coordinates of a point (u, v) of a body at a pose."""
    x, y, theta = pose
    u, v = point
    cos, sin = math.cos(theta), math.sin(theta)
    return x + u * cos + v * sin, y - u * sin + v * cos


def interpolate_pose(start: Pose, end: Pose, fraction: float) -> Pose:
    """The pose at a fraction in [0, 1] of the way from start to end; the angle takes the shorter way."""
    turn = (end[2] - start[2] + math.pi) % (2 * math.pi) - math.pi
    x, y = (a + fraction * (b - a) for a, b in zip(start[:2], end[:2], strict=True))
    return x, y, start[2] + fraction * turn


def square(centre: Sequence[float], side: float) -> tuple[Point, ...]:
    """Corners of an axis-aligned square."""
    (x, y), half = centre, side / 2
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def circle(centre: Sequence[float], radius: float, corners: int = 32) -> tuple[Point, ...]:
    """Corners of a regular polygon that approximates a circle."""
    turns = (2 * math.pi * corner / corners for corner in range(corners))
    return tuple((centre[0] + radius * math.cos(turn), centre[1] + radius * math.sin(turn)) for turn in turns)
