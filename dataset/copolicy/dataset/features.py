"""The columns of a LeRobot data set of a task, and the fixed bounds that scale them.

The bounds come from the task, never from data: a goal that is constant in the training set would explode under
min-max statistics on any other map.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .task_spec import TaskSpec, Vector

STATE = "observation.state"
ENVIRONMENT_STATE = "observation.environment_state"
HUMAN_ACTION = "observation.human_action"
ACTION = "action"
VECTORS = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)
"""The columns of vectors: `(N, n)` in memory even where n is 1, a column that LeRobot stores as plain numbers."""

SCENE_IMAGE = "observation.images.scene"
"""The optional image of the scene, without the actions."""

SCENE_SIZE = (600, 300)
"""Its width and height, px, unless other ones are asked for."""

SCENE_SIDES = (64, 3840)
"""The shortest and the longest side that it may have, px."""

OBSERVATION_KEYS = {"agent_pos": STATE, "environment_state": ENVIRONMENT_STATE, "human_action": HUMAN_ACTION}
"""Names of the observations in the environment and in exports, and their columns.

`agent_pos` and `environment_state` are what LeRobot reads from a gymnasium environment as `observation.state` and
`observation.environment_state`.
"""

GYM_ID = "copolicy/TableCarrying-v0"
"""Name of the environment in gymnasium's registry; importing `lerobot_policy_copolicy` registers it."""

PAIR_GYM_ID = "copolicy/PairTask-v0"
"""Name of the environment of any task, `gymnasium.make(PAIR_GYM_ID, task="peg")`."""


def features_of(spec: TaskSpec) -> dict[str, dict[str, Any]]:
    """LeRobot's feature table of a task."""
    return {
        **{
            column: {"dtype": "float32", "shape": (len(vector),), "names": list(vector.names)}
            for column, vector in _vectors(spec).items()
        },
        "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
        "next.done": {"dtype": "bool", "shape": (1,), "names": None},
        "next.success": {"dtype": "bool", "shape": (1,), "names": None},
    }


def bounds_of(spec: TaskSpec) -> dict[str, np.ndarray]:
    """Lowest and highest value of each column of numbers, `(2, n)`."""
    return {column: vector.bounds for column, vector in _vectors(spec).items()}


def scaling_of(spec: TaskSpec, columns: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Factor and offset `(n,)`, float32, that bring columns, one beside the other, from their bounds to [-1, 1]."""
    low, high = np.concatenate([bounds_of(spec)[column] for column in columns], axis=1)
    return (2 / (high - low)).astype(np.float32), (-(high + low) / (high - low)).astype(np.float32)


def _vectors(spec: TaskSpec) -> dict[str, Vector]:
    joint, one = spec.joint_action, spec.action
    human = Vector(joint.names[len(one) :], one.units, one.low, one.high)
    return {STATE: spec.state, ENVIRONMENT_STATE: spec.scenario, HUMAN_ACTION: human, ACTION: joint}
