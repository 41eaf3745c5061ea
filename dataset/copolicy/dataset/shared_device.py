"""Whether one device moved both players."""

import numpy as np

_ALIKE = 0.01  # of a full force: nearer to each other two actions are the same
IDENTICAL = 0.99
"""Share of the frames with a force from which on the actions of both players count as one."""


def any_force(actions: np.ndarray) -> np.ndarray:
    """`(...)` whether anybody does anything in joint actions `(..., 2 n)`."""
    return np.abs(actions).max(axis=-1, initial=0.0) > _ALIKE


def same_action(actions: np.ndarray) -> np.ndarray:
    """`(...)` whether somebody does something and both do the same, in joint actions `(..., 2 n)`."""
    robot, human = np.split(actions, 2, axis=-1)
    same = np.abs(robot - human).max(axis=-1) <= _ALIKE
    return same & any_force(actions)


def identical_actions(actions: np.ndarray) -> bool:
    """Both players gave the same joint actions `(T, 2 n)` throughout; two who gave none did not."""
    pushed = np.count_nonzero(any_force(actions))
    return bool(pushed and np.count_nonzero(same_action(actions)) >= IDENTICAL * pushed)


def may_be_one_device(source: str, controller_0: str, controller_1: str) -> bool:
    """Two people may hold one device that the system lists twice: both have one of a kind that can be, no keyboard.

    Args:
        source: of the episode.
        controller_0: of the robot seat.
        controller_1: of the human seat.
    """
    return source == "human" and controller_0 == controller_1 and "keyboard" not in controller_0.lower()
