"""The gymnasium environment of the table-carrying task."""

import math

from copolicy.dataset.features import SCENE_SIZE
from copolicy.dataset.task import TABLE

from .pair_env import PairEnv


class TableCarryingEnv(PairEnv):
    """Two players carry a table past obstacles to a goal: `PairEnv` of the table.

    ## Action space
    `Box(-1, 1, (4,), float32)`: robot_fx, robot_fy, human_fx, human_fy in units of a player's full force, x to the
    right, y down; with a simulated `partner` `Box(-1, 1, (2,), float32)`, the robot's half.

    ## Observation space
    A `Dict` of float32 in px, rad and s:

    | key | shape | LeRobot column |
    |---|---|---|
    | agent_pos | (7,) | observation.state: x, y, cos_theta, sin_theta, vx, vy, omega |
    | environment_state | (11,) | observation.environment_state: start pose, goal, three obstacles padded with zeros |
    | human_action | (2,) | observation.human_action: what the human did in the previous frame, zero at the first |
    | pixels | {"scene": (height, width, 3) uint8}, with `pixels=True` only | observation.images.scene |

    ## Success and end
    The table touches the goal square; an obstacle or a wall ends the episode without success.

    Args:
        angular_acceleration_limit: rad/s^2.
        others: see `PairEnv`.
    """

    def __init__(
        self,
        fps: int = 10,
        map_set: str = "training",
        orientations: bool = False,
        step_limit: int = 1000,
        angular_acceleration_limit: float = math.pi / 2,
        partner: str = "",
        pixels: bool = False,
        observation_width: int = SCENE_SIZE[0],
        observation_height: int = SCENE_SIZE[1],
        render_mode: str | None = "rgb_array",
    ):
        settings = {"angular_acceleration_limit": angular_acceleration_limit}
        super().__init__(
            TABLE, fps, map_set, orientations, step_limit, partner, pixels, observation_width, observation_height,
            settings, render_mode,
        )  # fmt: skip
        self.task = "table_carrying"
