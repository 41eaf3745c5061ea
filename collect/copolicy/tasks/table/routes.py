"""The route class of a path: the side on which the table passed each obstacle."""

import math

import numpy as np

from copolicy.dataset.arrays import Array

from .map_config import MapConfig


def winding(path: Array, point: tuple[float, float]) -> float:
    """Turns of a path `(T, 2)` around a point, positive clockwise on screen (y down)."""
    angles = np.unwrap(np.arctan2(path[:, 1] - point[1], path[:, 0] - point[0]))
    return float(angles[-1] - angles[0]) / (2 * math.pi)


def route_class(path: Array, config: MapConfig) -> str:
    """The route class of a path `(T, 2)` of the table's centre, px: one letter an obstacle, empty without obstacles.

    L: the table passed below the obstacle on screen when carried to the right, R: above it; this is the sign of the
    winding around it. The letters are in the order of the obstacles sorted by atan2(y, x) of their position. Sides and
    order are those of Yang and Mavrogiannis' labels of the human demonstrations (HRI 2025), as far as documented.
    """
    ordered = sorted(config.obstacles, key=lambda centre: math.atan2(centre[1], centre[0]))
    return "".join("R" if winding(path, centre) > 0 else "L" for centre in ordered)
