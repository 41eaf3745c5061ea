"""Between the two players: the interaction force, and whether one device moved both of them."""

import numpy as np

_ALIKE = 0.01  # of a full force: nearer to each other two actions are the same
IDENTICAL = 0.99
"""Share of the frames with a force from which on the actions of both players count as one."""


def interaction_force(theta: np.ndarray | float, actions: np.ndarray, legacy_axis: bool = False) -> np.ndarray:
    """Half the difference of the two forces along the table, in units of a player's full force.

    f = (u_robot - u_human) . e / 2, with e = (cos theta, -sin theta) the axis from the human's end to the robot's
    in y-down pixels. Positive: the players pull apart. The original program uses e = (cos theta, +sin theta),
    which is the axis mirrored, and stores 2 x 50 times this value; the paper's thresholds have no published unit.

    Args:
        theta: orientation after the step, `(...)`, rad.
        actions: `(..., 4)` robot xy, human xy in [-1, 1].
        legacy_axis: the mirrored axis, for comparison with the original program.

    Returns:
        `(...)`, in [-sqrt(2), sqrt(2)].
    """
    actions = np.asarray(actions, dtype=float)
    sine = np.sin(theta) if legacy_axis else -np.sin(theta)
    difference = actions[..., :2] - actions[..., 2:]
    return (difference[..., 0] * np.cos(theta) + difference[..., 1] * sine) / 2


def pushing(actions: np.ndarray) -> np.ndarray:
    """`(...)` whether anybody gives a force in actions `(..., 4)` robot xy, human xy in [-1, 1]."""
    return np.abs(actions).max(axis=-1, initial=0.0) > _ALIKE


def alike(actions: np.ndarray) -> np.ndarray:
    """`(...)` whether somebody gives a force and both give the same, in actions `(..., 4)`."""
    same = np.abs(actions[..., :2] - actions[..., 2:]).max(axis=-1) <= _ALIKE
    return same & pushing(actions)


def identical(actions: np.ndarray) -> bool:
    """Both players gave the same actions `(T, 4)` throughout; two who gave none did not."""
    pushed = np.count_nonzero(pushing(actions))
    return bool(pushed and np.count_nonzero(alike(actions)) >= IDENTICAL * pushed)


def may_be_one_device(source: str, controller_0: str, controller_1: str) -> bool:
    """Two people may hold one device that the system lists twice: both have one of a kind that can be, no keyboard.

    Args:
        source: of the episode.
        controller_0: of the robot seat.
        controller_1: of the human seat.
    """
    return source == "human" and controller_0 == controller_1 and "keyboard" not in controller_0.lower()
