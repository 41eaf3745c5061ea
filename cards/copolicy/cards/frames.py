"""The frames of a data set, episode by episode: what figures and the report are drawn from."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.dataset.files.listing import visible_files
from copolicy.dataset.lerobot_folder.tables import feature_values, pa, read_parquet
from copolicy.tasks.table.features import FEATURES, map_of, theta_of
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS

from .facts import DatasetFacts

_COLUMNS = ["episode_index", "frame_index", STATE, ENVIRONMENT_STATE, ACTION]


@dataclass(frozen=True)
class EpisodeFrames:
    """The frames of one episode at the data set's rate.

    Attributes:
        index: `episode_index`.
        states: `(T, 7)` x, y, cos_theta, sin_theta, vx, vy, omega (px, px/s, rad/s).
        actions: `(T, 4)` robot xy, human xy in [-1, 1].
    """

    index: int
    states: np.ndarray
    actions: np.ndarray
    map_config: MapConfig

    @property
    def theta(self) -> np.ndarray:
        """`(T,)` orientation in [0, 2 pi), rad."""
        return theta_of(self.states)

    @property
    def interaction(self) -> np.ndarray:
        """`(T,)` interaction force, units of a player's full force.

        It is defined with the orientation after the step, which is that of the next frame; the last frame has none
        and uses its own.
        """
        theta = self.theta
        return interaction_force(np.append(theta[1:], theta[-1:]), self.actions)


def read_frames(facts: DatasetFacts) -> Iterator[EpisodeFrames]:
    """The episodes' frames in order, one data file in memory at a time.

    Raises:
        FileFormatError: a data file is missing, damaged, without the columns of this task, or holds other episodes
            than meta/episodes says.
    """
    expected = iter(facts.episodes)
    for path in visible_files(facts.root / "data", "*.parquet"):
        table = read_parquet(path, _COLUMNS)
        indices = feature_values(table, "episode_index", (1,), path)
        columns = {key: _matrix(table, key, path) for key in (STATE, ENVIRONMENT_STATE, ACTION)}
        cuts = [0, *(np.flatnonzero(np.diff(indices)) + 1), len(indices)] if len(indices) else []
        for start, end in pairwise(cuts):
            episode = next(expected, None)
            found = (int(indices[start]), int(end - start))
            if episode is None or found != (episode["episode_index"], episode["length"]):
                named = f"episode {episode['episode_index']} with {episode['length']} frames" if episode else "its end"
                raise FileFormatError(path, f"{named} as in meta/episodes", f"episode {found[0]} with {found[1]}")
            try:
                config = map_of(columns[ENVIRONMENT_STATE][start], _obstacle_size(episode), episode["obstacle_sizes"])
            except CopolicyError as error:
                raise FileFormatError(path, f"a map in episode {found[0]}", str(error)) from None
            yield EpisodeFrames(found[0], columns[STATE][start:end], columns[ACTION][start:end], config)
    left = next(expected, None)
    if left is not None:
        raise FileFormatError(facts.root / "data", f"the frames of episode {left['episode_index']}", "none")


def _matrix(table: "pa.Table", key: str, path: Path) -> np.ndarray:
    values = feature_values(table, key, FEATURES[key]["shape"], path).astype(float)
    if not np.isfinite(values).all():
        raise FileFormatError(path, f"finite {key}", "nan or inf")
    return values


def _obstacle_size(episode: dict[str, Any]) -> int:
    # In data sets of earlier versions no column tells it; all maps of a set have one size.
    maps = MAP_SETS.get(episode["map_set"])
    return episode["obstacle_size"] or (maps[0].obstacle_size if maps else MapConfig.obstacle_size)
