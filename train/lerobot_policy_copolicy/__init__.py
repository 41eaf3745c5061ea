"""LeRobot plugin of the table-carrying task: importing it registers the policy and the environment.

LeRobot imports this module because the distribution has the same name; networks, torch modules and the simulator
are imported only when a policy or an environment is built.
"""

from .copolicy.configuration_copolicy import CopolicyConfig
from .env.configuration_table_carrying import TableCarryingEnvConfig

__all__ = ["CopolicyConfig", "TableCarryingEnvConfig"]
