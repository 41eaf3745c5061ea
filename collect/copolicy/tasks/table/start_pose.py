"""Displaced start poses, so that a policy learns to recover from states beside the demonstrated paths."""

from dataclasses import replace

import numpy as np

from .map_config import MapConfig
from .world import TableWorld

_SHIFT = (90.0, 60.0)  # px, in x and y
_TURN = 0.6  # rad


def displaced_start(config: MapConfig, scale: float, rng: np.random.Generator) -> MapConfig:
    """The map with its start displaced by up to `scale` times 90 px in x, 60 px in y and 0.6 rad, without contact.

    Returns the map unchanged where all of 100 draws are in contact (a start between obstacles, a large scale).
    """
    world = TableWorld(config)
    x, y, theta = config.start
    for dx, dy, turn in rng.uniform(-1.0, 1.0, (100, 3)) * (*_SHIFT, _TURN) * scale:
        pose = (x + dx, y + dy, theta + turn)
        if not any(world.contact(pose)):
            return replace(config, start=pose)
    return config
