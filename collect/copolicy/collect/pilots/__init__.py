"""Simulated pilots: each holds one end of the table and sees nothing but its motion."""

from .habits import Habits
from .pairs import PAIRS, simulated_pair
from .partners import PARTNERS, simulated_partner
from .scripted import ScriptedPilot

__all__ = ["PAIRS", "PARTNERS", "Habits", "ScriptedPilot", "simulated_pair", "simulated_partner"]
