"""The human study: blind, counterbalanced sessions of one person with several robots, and what came of them."""

from .command import add_human_command

__all__ = ["add_human_command"]
