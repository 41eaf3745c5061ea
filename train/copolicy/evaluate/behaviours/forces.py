"""Dissent and passivity, from the forces of both players."""

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.statistics.forces import MIN_EFFORT

from .motion import Event, Motion

DISSENT_S = 0.2
"""Shortest time of dissent, s."""

PASSIVE_S = 1.0
"""Shortest time of passivity, s."""


def dissent(motion: Motion, order: Array | None, level: float) -> list[Event]:
    """Times in which the magnitude of the interaction measure is at least `level`; the score is its integral."""
    data = motion.frames
    interaction = motion.task.interaction(data.states, motion.joint_actions(order))
    assert interaction is not None  # a task with levels of dissent measures it
    size = np.abs(interaction)
    return [
        Event(episode, first, end, _integral(motion, size, episode, first, end), {})
        for episode, first, end in motion.runs(size >= level, DISSENT_S)
    ]


def passivity(motion: Motion, order: Array | None, seat: int) -> list[Event]:
    """Times in which only the partner of the player at `seat` applies a force; the score is its integral."""
    forces = np.split(motion.task.spec.full_forces(motion.joint_actions(order)), 2, axis=1)
    own, partner = (np.linalg.norm(forces[index], axis=1) for index in (seat, 1 - seat))
    flags = (own < MIN_EFFORT) & (partner >= MIN_EFFORT)
    return [
        Event(episode, first, end, _integral(motion, partner, episode, first, end), {})
        for episode, first, end in motion.runs(flags, PASSIVE_S)
    ]


def _integral(motion: Motion, values: Array, episode: int, first: int, end: int) -> float:
    start = motion.frames.starts[episode]
    return float(values[start + first : start + end].sum() / motion.frames.fps)
