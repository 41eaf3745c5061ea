"""Sweep: methods x seeds x map sets x studies as restartable tasks, on one machine or a cluster."""

from .command import add_sweep_command

__all__ = ["add_sweep_command"]
