"""Simulated pilots: each holds one end of the table and sees nothing but its motion.

Names are loaded when they are asked for: the habits, which flags list, need none of what finds routes.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .habits import Habits
    from .players import scripted_robot, simulated_pair, simulated_partner
    from .profiles import NEVER_YIELDS, PAIRS, PARTNERS, ROBOTS
    from .scripted import ScriptedPilot

__all__ = [
    "NEVER_YIELDS",
    "PAIRS",
    "PARTNERS",
    "ROBOTS",
    "Habits",
    "ScriptedPilot",
    "scripted_robot",
    "simulated_pair",
    "simulated_partner",
]

_MODULES = {
    "Habits": "habits",
    "ScriptedPilot": "scripted",
    **dict.fromkeys(("scripted_robot", "simulated_pair", "simulated_partner"), "players"),
    **dict.fromkeys(("NEVER_YIELDS", "PAIRS", "PARTNERS", "ROBOTS"), "profiles"),
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
