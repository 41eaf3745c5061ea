"""Simulated pilots: each holds one end of the table and sees nothing but its motion."""

from .habits import Habits
from .pairs import PAIRS, simulated_pair
from .scripted import ScriptedPilot

__all__ = ["PAIRS", "Habits", "ScriptedPilot", "simulated_pair"]
