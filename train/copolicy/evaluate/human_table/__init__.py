"""The paper's second and third table, success beside people and by set-up, from the recordings of a human study."""

from .command import add_human_table_command

__all__ = ["add_human_table_command"]
