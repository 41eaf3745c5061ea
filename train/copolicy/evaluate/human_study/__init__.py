"""The human study: blind, counterbalanced sessions of a person with several robots, and their summary."""

from .command import add_human_command

__all__ = ["add_human_command"]
