"""Simulated pilots: each holds one end of the table and sees nothing but its motion.

Names are loaded when they are asked for: the habits, which flags list, need none of what finds routes.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .habits import Habits
    from .pair_habits import PAIRS
    from .pairs import simulated_pair
    from .partners import PARTNERS, simulated_partner
    from .scripted import ScriptedPilot

__all__ = ["PAIRS", "PARTNERS", "Habits", "ScriptedPilot", "simulated_pair", "simulated_partner"]

_MODULES = {
    "PAIRS": "pair_habits",
    "PARTNERS": "partners",
    "Habits": "habits",
    "ScriptedPilot": "scripted",
    "simulated_pair": "pairs",
    "simulated_partner": "partners",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
