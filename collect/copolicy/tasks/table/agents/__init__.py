"""Scripted players: each acts at one end of the table and observes only the table's state.

`scripted_player` and with it scipy are imported when a player is made, so that command-line flags can list names.
"""

from .players import scripted_robot, simulated_pair, simulated_partner
from .profiles import NEVER_YIELDS, PAIRS, PARTNERS, ROBOTS, PlayerProfile

__all__ = [
    "NEVER_YIELDS", "PAIRS", "PARTNERS", "ROBOTS", "PlayerProfile",
    "scripted_robot", "simulated_pair", "simulated_partner",
]  # fmt: skip
