"""Gymnasium environments of two-player tasks, for `lerobot-train` and `lerobot-eval` too."""

from .configuration import PairTaskEnvConfig
from .configuration_table_carrying import TableCarryingEnvConfig

__all__ = ["PairTaskEnvConfig", "TableCarryingEnvConfig"]
