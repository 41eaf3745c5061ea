"""Simulated pilots: each holds one end of the table and sees nothing but its motion.

Names are loaded when they are asked for: the habits, which flags list, need none of what finds routes.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

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

__getattr__ = lazy_names(
    __name__,
    {
        "Habits": "habits",
        "ScriptedPilot": "scripted",
        **dict.fromkeys(("scripted_robot", "simulated_pair", "simulated_partner"), "players"),
        **dict.fromkeys(("NEVER_YIELDS", "PAIRS", "PARTNERS", "ROBOTS"), "profiles"),
    },
)
