"""The paper's co-planning table: several methods, each with trainings of several seeds, on the same maps."""

from .command import add_coplanning_table_command

__all__ = ["add_coplanning_table_command"]
