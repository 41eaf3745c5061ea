"""Images of the scene for policies, in videos of data sets and in the environment; needs no display."""

import functools

import numpy as np

from copolicy.collect.screen.canvas import new_surface
from copolicy.collect.sdl import pygame
from copolicy.dataset.arrays import Array
from copolicy.dataset.features import SCENE_SIZE
from copolicy.dataset.outline import Pose

from ..map_config import MapConfig
from .table_view import TableView


class SceneImage:
    """Draws images of the table on a map.

    An image shows the map and the table before the frame's action, without the arrows of the forces, from which a
    policy could read the action. Where the size is not twice as wide as high, black bars are added.
    """

    def __init__(self, map_config: MapConfig, size: tuple[int, int] = SCENE_SIZE):
        self._surface = new_surface(size)
        self._view = TableView(map_config)

    def draw(self, pose: Pose) -> Array:
        """The image at a pose (px, px, rad): `(height, width, 3)` uint8."""
        self._view.draw(self._surface, self._surface.get_rect(), pose)
        return np.ascontiguousarray(pygame.surfarray.array3d(self._surface).swapaxes(0, 1))


@functools.lru_cache(maxsize=4)
def scene_image(map_config: MapConfig, size: tuple[int, int]) -> SceneImage:
    """A cached `SceneImage`, since an environment draws one image at a time."""
    return SceneImage(map_config, size)
