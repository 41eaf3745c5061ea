"""Paired comparison of study results: several methods on the same starts."""

from .command import add_compare_command

__all__ = ["add_compare_command"]
