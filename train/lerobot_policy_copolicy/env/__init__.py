"""Tasks for two players as gymnasium environments that `lerobot-train` and `lerobot-eval` can run."""

from .configuration import PairTaskEnvConfig
from .configuration_table_carrying import TableCarryingEnvConfig

__all__ = ["PairTaskEnvConfig", "TableCarryingEnvConfig"]
