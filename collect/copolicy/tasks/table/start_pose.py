"""Episodes that begin beside a map's start, so that a policy learns to come back from there."""

from dataclasses import replace

import numpy as np

from .map_config import MapConfig
from .world import TableWorld

_SHIFT = (90.0, 60.0)  # px, in x and y
_TURN = 0.6  # rad


def displaced_start(config: MapConfig, scale: float, rng: np.random.Generator) -> MapConfig:
    """The map with its start moved by up to `scale` times 90 px in x, 60 px in y and 0.6 rad, touching nothing.

    The map's own start comes back where a hundred draws touch something (a start between obstacles, a large scale).
    """
    world = TableWorld(config)
    x, y, theta = config.start
    for dx, dy, turn in rng.uniform(-1.0, 1.0, (100, 3)) * (*_SHIFT, _TURN) * scale:
        pose = (x + dx, y + dy, theta + turn)
        if not any(world.contact(pose)):
            return replace(config, start=pose)
    return config
