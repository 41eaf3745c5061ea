"""Positions and interaction of an episode at the task's rate, so that sources of all rates are measured alike."""

from typing import NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import stride
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.task import PairTask

from ..trajectories import Trajectory

SAMPLING = (
    "Positions are interpolated linearly to the task's rate, and the interaction measure of a frame is held: a source "
    "of 10 Hz and one of 30 Hz are measured alike. The interaction measure uses the state after the action; the last "
    "frame of a data set its own state."
)


class Samples(NamedTuple):
    """Equally spaced samples of one episode, each of the same duration.

    Attributes:
        positions: `(n, 2)` of the tracked point, in the unit of the outline.
        interaction: `(n,)` the task's interaction measure; None if it has none.
    """

    positions: Array
    interaction: Array | None


def path_of(task: PairTask, states: Array) -> Array:
    """`(T, 2)` positions of the tracked point, or else of the outline's body.

    Raises:
        CopolicyError: the task has no outline.
    """
    path = task.tracked_path(states)
    if path is None:
        raise CopolicyError(task.missing("outline"))
    return path


def states_after(episode: Trajectory) -> Array:
    """`(T, n)` the state after each action."""
    last = episode.states[-1] if episode.final_state is None else episode.final_state
    return np.vstack((episode.states[1:], last))


def interaction_of(task: PairTask, episode: Trajectory) -> Array | None:
    """`(T,)` the interaction measure of each action; None if the task has none."""
    return task.interaction(states_after(episode), episode.actions)


def frames(task: PairTask, episode: Trajectory) -> Samples:
    """The frames as stored, one sample each."""
    return Samples(path_of(task, episode.states), interaction_of(task, episode))


def resampled(task: PairTask, episode: Trajectory) -> Samples:
    """Samples at the task's rate, see `SAMPLING`."""
    hold = stride(episode.fps, task.spec.record_hz)
    before, after = path_of(task, episode.states), path_of(task, states_after(episode))
    fractions = (np.arange(hold) / hold)[:, None]
    positions = (before[:, None] + fractions * (after - before)[:, None]).reshape(-1, 2)
    interaction = interaction_of(task, episode)
    return Samples(positions, None if interaction is None else np.repeat(interaction, hold))
