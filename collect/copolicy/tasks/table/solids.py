"""The table, the obstacles and the goal as pymunk shapes."""

import pymunk

from .geometry import BOARD, BOARD_CORNER_RADIUS, CIRCLE_CENTRE, CIRCLE_FRINGE, CIRCLE_RADIUS, TRIANGLE


def table_shapes(body: pymunk.Body) -> tuple[pymunk.Shape, ...]:
    """Circle, board and triangle of the table on a body whose angle is minus theta (pymunk turns from x to y)."""
    left, top, right, bottom = BOARD
    r = BOARD_CORNER_RADIUS
    inner = [(left + r, top + r), (right - r, top + r), (right - r, bottom - r), (left + r, bottom - r)]
    return (
        pymunk.Circle(body, CIRCLE_RADIUS + CIRCLE_FRINGE, CIRCLE_CENTRE),
        pymunk.Poly(body, inner, radius=r),
        pymunk.Poly(body, list(TRIANGLE)),
    )


def square_shape(body: pymunk.Body, centre: tuple[float, float], size: int) -> pymunk.Poly:
    """An obstacle or the goal as the convex hull of its pixels' centres.

    The original truncates the corner of the square to a whole pixel and compares pixels, so a table that overlaps the
    square by less than half a pixel does not touch it.
    """
    left, top = (int(value - size / 2) for value in centre)
    near, far = 0.5, size - 0.5
    corners = [(left + u, top + v) for u, v in ((near, near), (far, near), (far, far), (near, far))]
    return pymunk.Poly(body, corners)
