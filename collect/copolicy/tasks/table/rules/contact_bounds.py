"""Bounds on the contacts of the table, without the world's contact queries.

Two rectangles bracket the table: an outer one that contains all its parts, and an inner one inside its board. The table
did not touch what the outer one does not reach, and touched what the inner one reaches.
"""

import numpy as np

from copolicy.dataset.arrays import Array

Rectangle = tuple[float, float, float]
"""Offset of the middle along the table, half length and half width, px."""

OUTER: Rectangle = (0.0, 95.8, 29.5)
"""Circle, board and triangle of 191 x 59 px, with the fringe of the circle's pixels."""

INNER: Rectangle = (-2.5, 54.0, 16.5)
"""The board without its rounded corners."""


def separation(positions: Array, thetas: Array, rectangle: Rectangle, centres: Array, half: Array | float) -> Array:
    """`(M,)` largest gap along the four axes of a rotated rectangle and an upright square, px; negative in an overlap.

    By the separating axis theorem two convex shapes are apart if and only if one of these gaps is positive.

    Args:
        positions: `(M, 2)` the table's centre, px.
        thetas: `(M,)` orientation, rad, counter-clockwise on screen.
        centres: `(M, 2)` of the squares, px.
        half: half a side of the squares, px.
    """
    offset, length, width = rectangle
    cos, sin = np.cos(thetas), np.sin(thetas)
    along, across = np.column_stack((cos, -sin)), np.column_stack((sin, cos))
    between = centres - (positions + offset * along)
    turned = np.abs(cos) + np.abs(sin)
    gaps = (
        np.abs(between[:, 0]) - (length * np.abs(cos) + width * np.abs(sin) + half),
        np.abs(between[:, 1]) - (length * np.abs(sin) + width * np.abs(cos) + half),
        np.abs((between * along).sum(axis=1)) - (length + half * turned),
        np.abs((between * across).sum(axis=1)) - (width + half * turned),
    )
    return np.maximum.reduce(gaps)


def final_poses(states: Array, fps: float, record_hz: int) -> tuple[Array, Array, float]:
    """Possible poses at the end of the last frame's action, which took one to `record_hz / fps` steps.

    Args:
        states: `(F, 7)` state of the last frame.

    Returns:
        Positions `(J, F, 2)` and orientations `(J, F)` after each number of steps, and the largest error, px, of the
        assumption of a constant velocity.
    """
    steps = max(round(record_hz / fps), 1)
    seconds = np.arange(1, steps + 1)[:, None] / record_hz
    positions = states[None, :, :2] + states[None, :, 4:6] * seconds[..., None]
    thetas = np.arctan2(states[:, 3], states[:, 2]) + states[:, 6] * seconds
    # Half of the largest acceleration, 50 px/s^2, plus half of that of the table's end, 96 px x pi/2 rad/s^2.
    return positions, thetas, 100.0 / fps**2
