"""LeRobot plugin of the table-carrying task: importing it registers policy, environment and teleoperator.

LeRobot imports this module because the distribution has the same name; networks, torch modules, the simulator
and pygame are imported only when a policy, an environment or a teleoperator is built.
"""

from .copolicy.configuration_copolicy import CopolicyConfig
from .env.configuration_table_carrying import TableCarryingEnvConfig
from .teleoperator.config_copolicy_pair import CopolicyPairConfig

__all__ = ["CopolicyConfig", "CopolicyPairConfig", "TableCarryingEnvConfig"]
