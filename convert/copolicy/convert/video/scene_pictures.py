"""Pictures of the frames of an episode, drawn without a display."""

from collections.abc import Iterator

import numpy as np

from copolicy.dataset.features import theta_of
from copolicy.tasks.table.artist.scene_image import SceneImage
from copolicy.tasks.table.map_config import MapConfig


def scene_pictures(states: np.ndarray, map_config: MapConfig, size: tuple[int, int]) -> Iterator[np.ndarray]:
    """For each state of `(T, 7)` its picture, `(height, width, 3)` uint8, as `SceneImage` draws it."""
    image = SceneImage(map_config, size)
    for (x, y), theta in zip(states[:, :2].tolist(), theta_of(states).tolist(), strict=True):
        yield image.draw((x, y, theta))
