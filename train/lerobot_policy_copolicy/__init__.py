"""LeRobot plugin for tasks of two players: importing it registers the policy, environments and teleoperator.

LeRobot imports this module because the distribution has the same name; networks, the simulator and pygame are imported
only when a policy, an environment or a teleoperator is created.
"""

from .bc_lstm_gmm.configuration_bc_lstm_gmm import BcLstmGmmConfig
from .cogail.configuration_cogail import CoGailConfig
from .copolicy.configuration_copolicy import CopolicyConfig
from .env import PairTaskEnvConfig, TableCarryingEnvConfig
from .teleoperator.config_copolicy_pair import CopolicyPairConfig
from .vrnn.configuration_vrnn import VrnnConfig

__all__ = [
    "BcLstmGmmConfig",
    "CoGailConfig",
    "CopolicyConfig",
    "CopolicyPairConfig",
    "PairTaskEnvConfig",
    "TableCarryingEnvConfig",
    "VrnnConfig",
]
