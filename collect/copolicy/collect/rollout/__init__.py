"""Worlds that two agents act in, step by step: what play, simulation, studies and the check of a recording share."""

from .agent import Agent, Start
from .rollout import Observer, Rollout
from .trace import Trace

__all__ = ["Agent", "Observer", "Rollout", "Start", "Trace"]
