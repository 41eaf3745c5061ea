"""The table-carrying task as a gymnasium environment that `lerobot-train` and `lerobot-eval` can run."""

from .configuration_table_carrying import TableCarryingEnvConfig

__all__ = ["TableCarryingEnvConfig"]
