"""Behaviours of pairs: adaptation, leadership, passivity, pivoting and dissent, with null distributions."""

from .command import add_behaviours_command

__all__ = ["add_behaviours_command"]
