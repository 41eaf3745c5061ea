"""Pictures of the frames of an episode, drawn without a display."""

from collections.abc import Iterator

import numpy as np

from copolicy.collect.screen.table_view import TableView
from copolicy.collect.sdl import pygame
from copolicy.dataset.features import theta_of
from copolicy.dataset.task import MapConfig


def scene_pictures(states: np.ndarray, map_config: MapConfig, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """For each state of `(T, 7)` its picture, `(height, width, 3)` uint8.

    A picture shows what is there before the frame's action: map and table, and no arrows of the forces, which would
    give the action away to whoever learns it from the picture. Where the size is not twice as wide as high, black
    bars fill the rest.
    """
    # pygame 2.6 crashes where it draws smooth lines near the edge of a surface of 24 bits.
    surface = pygame.Surface(size, depth=32)
    view = TableView(map_config)
    for (x, y), theta in zip(states[:, :2].tolist(), theta_of(states).tolist(), strict=True):
        view.draw(surface, surface.get_rect(), (x, y, theta))
        yield np.ascontiguousarray(pygame.surfarray.array3d(surface).swapaxes(0, 1))
