"""The gymnasium environment of the table-carrying task."""

from .configuration_table_carrying import TableCarryingEnvConfig
from .pair_env import PairEnv


class TableCarryingEnv(PairEnv):
    """Two players carry a table past obstacles to a goal: `PairEnv` with the table's defaults.

    ## Action space
    `Box(-1, 1, (4,), float32)`: robot_fx, robot_fy, human_fx, human_fy in units of a player's full force, x to the
    right, y down. With a simulated `partner`: `Box(-1, 1, (2,), float32)`, the robot's half.

    ## Observation space
    A `Dict` of float32 in px, rad and s:

    | key | shape | LeRobot column |
    |---|---|---|
    | agent_pos | (7,) | observation.state: x, y, cos_theta, sin_theta, vx, vy, omega |
    | environment_state | (11,) | observation.environment_state: start pose, goal, three obstacles padded with zeros |
    | human_action | (2,) | observation.human_action: the human's action of the previous frame, zero at the first |
    | pixels | {"scene": (height, width, 3) uint8}, with `pixels=True` only | observation.images.scene |

    ## Success and end
    Success when the table touches the goal square; a collision with an obstacle or a wall is a failure.

    Args:
        settings: see `TableCarryingEnvConfig`.
    """

    config_type = TableCarryingEnvConfig

    def __init__(self, **settings):
        super().__init__(**settings)
        self.task = "table_carrying"
