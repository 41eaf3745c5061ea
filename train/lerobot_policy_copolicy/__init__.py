"""LeRobot plugin for tasks of two players: importing it registers the policy, environments and teleoperator.

LeRobot imports this module because the distribution has the same name; networks, the simulator and pygame are imported
only when a policy, an environment or a teleoperator is created.
"""

from .copolicy.configuration_copolicy import CopolicyConfig
from .env import PairTaskEnvConfig, TableCarryingEnvConfig
from .teleoperator.config_copolicy_pair import CopolicyPairConfig

__all__ = ["CopolicyConfig", "CopolicyPairConfig", "PairTaskEnvConfig", "TableCarryingEnvConfig"]
