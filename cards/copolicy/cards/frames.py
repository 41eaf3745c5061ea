"""The frames of a data set, episode by episode: what figures and the report are drawn from."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE, features_of
from copolicy.dataset.task import require_table
from copolicy.tasks.table.features import theta_of
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig

from .facts import DatasetFacts


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
    task = facts.folder.task
    require_table(task, facts.root)
    features = features_of(task.spec)
    shapes = {name: features[name]["shape"] for name in (STATE, ENVIRONMENT_STATE, ACTION)}
    for index, columns in facts.folder.frames(shapes):
        states, environment, actions = (columns[name].astype(float) for name in shapes)
        try:
            config = task.scenario_of_vector(environment[0], facts.episodes[index])
        except CopolicyError as error:
            raise FileFormatError(facts.root / "data", f"a map in episode {index}", str(error)) from None
        yield EpisodeFrames(index, states, actions, config)
