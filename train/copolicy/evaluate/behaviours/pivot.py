"""Pivoting around an obstacle: the body turns about one of its ends beside an obstacle."""

import math

import numpy as np

from copolicy.dataset.arrays import Array

from ..partner_study.clearance import distances, placed
from .motion import Event, Motion

SPIN = 0.3
"""Slowest turn, rad/s."""

HAND_SPEEDS = 0.4
"""Largest ratio of the speeds of the two ends."""

TURN = math.radians(30)
"""Smallest angle of a pivot, rad."""


def pivots(motion: Motion, obstacles: Array | None) -> list[Event]:
    """Turns about one end within half the distance of both ends from an obstacle; the score is the angle, rad.

    Args:
        obstacles: `(E,)` indices of the episodes whose obstacles replace those of each episode, for the null
            distribution.
    """
    data = motion.frames
    near = math.dist(*motion.task.required_outline.hands) / 2
    flags, angles = np.zeros(len(data.states), bool), np.zeros(len(data.states))
    for index, (start, end) in enumerate(zip(data.starts, data.ends, strict=True)):
        if end - start < 3:
            continue
        states = data.states[start:end]
        turning, angles[start:end] = _turns(motion, states)
        scenario = data.rows[index if obstacles is None else int(obstacles[index])].scenario
        distance = distances(motion.task, scenario, states[turning]) if turning.any() else None
        if distance is not None:
            flags[start:end][turning] = distance <= near
    events = []
    for index, first, last in motion.runs(flags, 2 / data.fps):
        offset = data.starts[index]
        angle = abs(float(angles[offset + last - 1] - angles[offset + first]))
        if angle >= TURN:
            events.append(Event(index, first, last, angle, {}))
    return events


def _turns(motion: Motion, states: Array) -> tuple[Array, Array]:
    """`(T,)` whether the body turns about one end in the states of an episode, and its angle, rad, without jumps."""
    outline = motion.task.required_outline
    poses = outline.poses(states)
    theta = np.unwrap(poses[:, 2])
    spin = np.gradient(theta) * motion.frames.fps
    ends = placed(np.array(outline.hands), poses)  # (T, 2, 2)
    slow, fast = np.sort(np.linalg.norm(np.gradient(ends, axis=0), axis=-1), axis=1).T
    return (np.abs(spin) >= SPIN) & (slow <= HAND_SPEEDS * fast), theta
