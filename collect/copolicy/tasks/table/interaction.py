"""The interaction force between the two players."""

import numpy as np

from copolicy.dataset.arrays import Array


def interaction_force(theta: Array | float, actions: Array, legacy_axis: bool = False) -> Array:
    """Half the difference of the two forces along the table, in units of a player's full force.

    f = (u_robot - u_human) . e / 2, with e = (cos theta, -sin theta) the axis from the human's end to the robot's
    in y-down pixels. Positive: the players pull apart. The original program uses e = (cos theta, +sin theta),
    which is the axis mirrored, and stores 2 x 50 times this value; the paper's thresholds have no published unit.

    Args:
        theta: orientation after the step, `(...)`, rad.
        actions: `(..., 4)` robot xy, human xy in [-1, 1].
        legacy_axis: use the mirrored axis, for comparison with the original program.

    Returns:
        `(...)`, in [-sqrt(2), sqrt(2)].
    """
    actions = np.asarray(actions, dtype=float)
    sine = np.sin(theta) if legacy_axis else -np.sin(theta)
    difference = actions[..., :2] - actions[..., 2:]
    return (difference[..., 0] * np.cos(theta) + difference[..., 1] * sine) / 2
