"""What a task looks like from above, in plain numbers: all that figures, pages and films need to draw it."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

Point = tuple[float, float]
Pose = tuple[float, float, float]
"""x, y in the unit of the outline, and theta in rad, counter-clockwise on screen."""


class Shape(NamedTuple):
    """A polygon; `role` is obstacle, goal or start of what stands still, body, robot or human of what moves."""

    role: str
    corners: tuple[Point, ...]


class Outline(Protocol):
    """The part `outline` of a task. x points to the right, y down, the origin is the upper left corner.

    Attributes:
        size: width and height of the scene.
        unit: of lengths, `px` or `m`.
        arrow: length of a player's full force, as it is drawn.
        body: what moves, in its own coordinates (u, v): where it is in the pose (0, 0, 0).
        hands: where the robot's and the human's seat hold it, in the same coordinates.
    """

    size: tuple[float, float]
    unit: str
    arrow: float
    body: tuple[Shape, ...]
    hands: tuple[Point, Point]

    def fixed(self, scenario: Any) -> tuple[Shape, ...]:
        """What stands still in a scenario: goal, start and obstacles, in the order in which they are drawn."""
        ...

    def poses(self, states: np.ndarray) -> np.ndarray:
        """`(T, 3)` the poses of the body in states `(T, n)`."""
        ...

    def forces(self, actions: np.ndarray) -> np.ndarray:
        """`(T, 4)` joint actions `(T, m)` as arrows: robot xy, human xy, of length 1 at full force."""
        ...


def to_scene(pose: Pose, point: Point) -> Point:
    """Where a point (u, v) of a body is in the scene."""
    x, y, theta = pose
    u, v = point
    cos, sin = math.cos(theta), math.sin(theta)
    return x + u * cos + v * sin, y - u * sin + v * cos


def interpolate_pose(start: Pose, end: Pose, share: float) -> Pose:
    """The pose at a share in [0, 1] of the way, turned the shorter way round."""
    turn = (end[2] - start[2] + math.pi) % (2 * math.pi) - math.pi
    x, y = (a + share * (b - a) for a, b in zip(start[:2], end[:2], strict=True))
    return x, y, start[2] + share * turn


def square(centre: Sequence[float], side: float) -> tuple[Point, ...]:
    """Corners of a square along the axes."""
    (x, y), half = centre, side / 2
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def circle(centre: Sequence[float], radius: float, corners: int = 32) -> tuple[Point, ...]:
    """A regular polygon that looks round."""
    turns = (2 * math.pi * corner / corners for corner in range(corners))
    return tuple((centre[0] + radius * math.cos(turn), centre[1] + radius * math.sin(turn)) for turn in turns)
