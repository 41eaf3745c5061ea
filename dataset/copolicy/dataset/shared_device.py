"""Detects that one input device controlled both players."""

import numpy as np

from .arrays import Array

_TOLERANCE = 0.01  # full forces; differences up to this count as equal, forces up to this as zero
IDENTICAL = 0.99
"""Proportion of the frames with a force from which on both players' actions count as identical."""


def any_force(actions: Array) -> Array:
    """`(...)` whether a player applies a force, from joint actions `(..., 2 n)`."""
    return np.abs(actions).max(axis=-1, initial=0.0) > _TOLERANCE


def same_action(actions: Array) -> Array:
    """`(...)` whether both players apply the same force, not zero, from joint actions `(..., 2 n)`."""
    robot, human = np.split(actions, 2, axis=-1)
    return (np.abs(robot - human).max(axis=-1) <= _TOLERANCE) & any_force(actions)


def identical_actions(actions: Array) -> bool:
    """Whether both players' actions are the same throughout `(T, 2 n)`; False if neither applies a force."""
    active_frames = np.count_nonzero(any_force(actions))
    return bool(active_frames and np.count_nonzero(same_action(actions)) >= IDENTICAL * active_frames)


def may_be_one_device(source: str, controller_0: str, controller_1: str) -> bool:
    """Whether both people may use one device that the system lists twice: equal controller names, no keyboard.

    The arguments are the episode columns of these names.
    """
    return source == "human" and controller_0 == controller_1 and "keyboard" not in controller_0.lower()
