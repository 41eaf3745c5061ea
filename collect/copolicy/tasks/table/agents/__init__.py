"""Simulated pilots: each holds one end of the table and sees nothing but its motion.

What finds routes (`scripted`) is loaded with the first of them: flags, which list the habits, need none of it.
"""

from .players import scripted_robot, simulated_pair, simulated_partner
from .profiles import NEVER_YIELDS, PAIRS, PARTNERS, ROBOTS, Habits

__all__ = [
    "NEVER_YIELDS", "PAIRS", "PARTNERS", "ROBOTS", "Habits", "scripted_robot", "simulated_pair", "simulated_partner",
]  # fmt: skip
