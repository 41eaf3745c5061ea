"""Reads the frames of a data set episode by episode, for figures and the report."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE, features_of
from copolicy.dataset.task import PairTask

from .facts import DatasetFacts


@dataclass(frozen=True)
class EpisodeFrames:
    """The frames of one episode at the data set's rate.

    Attributes:
        index: `episode_index`.
        states: `(T, n)`, as the task's spec names them.
        actions: `(T, m)`, robot first.
        scenario: scenario of the episode.
    """

    index: int
    states: Array
    actions: Array
    scenario: Any
    task: PairTask

    @property
    def interaction(self) -> Array | None:
        """The task's interaction measure `(T,)`, None if it has none.

        The measure uses the state after the step, here the state of the next frame; the last frame uses its own state.
        """
        return self.task.interaction(np.vstack((self.states[1:], self.states[-1:])), self.actions)


def read_frames(facts: DatasetFacts) -> Iterator[EpisodeFrames]:
    """Yields the episodes' frames in order, one data file in memory at a time.

    Raises:
        FileFormatError: a data file is missing or damaged, lacks columns of the task, or contradicts meta/episodes.
    """
    features = features_of(facts.task.spec)
    shapes = {name: features[name]["shape"] for name in (STATE, ENVIRONMENT_STATE, ACTION)}
    for index, columns in facts.folder.frames(shapes):
        states, environment, actions = (columns[name].astype(float) for name in shapes)
        try:
            scenario = facts.task.scenario_of_vector(environment[0], facts.episodes[index])
        except CopolicyError as error:
            raise FileFormatError(facts.root / "data", f"a map in episode {index}", str(error)) from None
        yield EpisodeFrames(index, states, actions, scenario, facts.task)
