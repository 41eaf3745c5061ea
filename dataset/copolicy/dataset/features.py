"""Feature columns of a task's LeRobot data set, and the fixed bounds that scale them.

The bounds come from the task, not from the data: a goal that is constant in the training set has a min-max range of
zero, so that any other goal would be scaled to infinity.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .arrays import Array
from .task_spec import TaskSpec, Vector

STATE = "observation.state"
ENVIRONMENT_STATE = "observation.environment_state"
HUMAN_ACTION = "observation.human_action"
ACTION = "action"
VECTORS = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)
"""The vector columns: `(N, n)` in memory, also if n is 1, which LeRobot stores as scalars."""

SCENE_IMAGE = "observation.images.scene"
"""The optional image of the scene; it does not show the actions."""

SCENE_SIZE = (600, 300)
"""Default width and height of the scene image, px."""

SCENE_SIDES = (64, 3840)
"""Shortest and longest side allowed for the scene image, px."""

OBSERVATION_KEYS = {"agent_pos": STATE, "environment_state": ENVIRONMENT_STATE, "human_action": HUMAN_ACTION}
"""Observation names of the environment and of exports, each with its column.

LeRobot reads `agent_pos` and `environment_state` of a gymnasium environment as `observation.state` and
`observation.environment_state`.
"""

GYM_ID = "copolicy/TableCarrying-v0"
"""Gymnasium id of the table environment; importing `lerobot_policy_copolicy` registers it."""

PAIR_GYM_ID = "copolicy/PairTask-v0"
"""Gymnasium id of the environment for any task: `gymnasium.make(PAIR_GYM_ID, task="peg")`."""


def features_of(spec: TaskSpec) -> dict[str, dict[str, Any]]:
    """LeRobot's `features` entry of `meta/info.json` for a task."""
    return {
        **{
            column: {"dtype": "float32", "shape": (len(vector),), "names": list(vector.names)}
            for column, vector in _vectors(spec).items()
        },
        "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
        "next.done": {"dtype": "bool", "shape": (1,), "names": None},
        "next.success": {"dtype": "bool", "shape": (1,), "names": None},
    }


def bounds_of(spec: TaskSpec) -> dict[str, Array]:
    """Lowest and highest values of each vector column, `(2, n)`."""
    return {column: vector.bounds for column, vector in _vectors(spec).items()}


def scaling_of(spec: TaskSpec, columns: Sequence[str]) -> tuple[Array, Array]:
    """Factor and offset, `(n,)` float32 each, that scale the concatenated columns from their bounds to [-1, 1]."""
    low, high = np.concatenate([bounds_of(spec)[column] for column in columns], axis=1)
    return (2 / (high - low)).astype(np.float32), (-(high + low) / (high - low)).astype(np.float32)


def _vectors(spec: TaskSpec) -> dict[str, Vector]:
    joint, single = spec.joint_action, spec.action
    human = Vector(joint.names[len(single) :], single.units, single.low, single.high)
    return {STATE: spec.state, ENVIRONMENT_STATE: spec.scenario, HUMAN_ACTION: human, ACTION: joint}
