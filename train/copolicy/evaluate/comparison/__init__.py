"""Paired comparison of results: the same starts, two methods."""

from .command import add_compare_command

__all__ = ["add_compare_command"]
