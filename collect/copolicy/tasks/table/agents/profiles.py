"""Habits of simulated players: of five pairs, of kinds of partner to judge a robot with, and of scripted robots."""

import math
from dataclasses import dataclass, fields

from copolicy.dataset.exceptions import InvalidValueError


@dataclass(frozen=True)
class Habits:
    """How one simulated player carries."""

    speed: float = 48.0
    """Speed that it aims for on a free path, px/s; two full forces reach 50."""
    effort: float = 1.0
    """Share of its half of the force: above 1 it leads, below 1 it leaves work to the other."""
    delay_steps: int = 4
    """Reaction time, steps of 1/30 s: it acts on what it saw so long ago."""
    noise: float = 0.1
    """Standard deviation of the slow noise on its force (Ornstein-Uhlenbeck, 0.5 s), of a full force."""
    impulsiveness: float = 0.4
    """It pushes in pulses of about a second, each weaker by up to this share of its force; 0 is steady."""
    effort_drift: float = 0.2
    """How much its effort wanders over some seconds, in logarithms of the force: who leads changes."""
    pauses_per_min: float = 2.0
    """How often it rests, for 0.4 to 1.2 s."""
    slips_per_min: float = 1.0
    """How often it slips: pushes somewhere for 0.2 to 0.5 s, with 0.4 to 0.9 of a full force."""
    route_temperature: float = 90.0
    """How freely it chooses its route, px: a route longer by so much is e times less likely."""
    left_bias: float = 0.0
    """Detour that it takes for passing one obstacle on side L (below it, when going right), px; negative for R."""
    patience_s: float = 1.0
    """How long it insists on its route while the other pulls towards another one, s."""
    clearance: float = 1.7
    """How wide it keeps from obstacles: 1 hugs them, 2.6 is wider than people go (they: 1.6 to 1.8)."""

    def __post_init__(self):
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if not math.isfinite(value) or (value < 0 and name != "left_bias"):
                raise InvalidValueError(f"Habits.{name}", "a finite number, not negative", value)
        for name in ("speed", "route_temperature", "clearance"):
            if not getattr(self, name) > 0:
                raise InvalidValueError(f"Habits.{name}", "a positive number", getattr(self, name))
        if not isinstance(self.delay_steps, int):
            raise InvalidValueError("Habits.delay_steps", "a whole number", self.delay_steps)
        if self.impulsiveness > 1:
            raise InvalidValueError("Habits.impulsiveness", "at most 1", self.impulsiveness)


PAIRS: dict[str, tuple[Habits, Habits]] = {
    # Two of a kind.
    "S01": (Habits(), Habits(delay_steps=3, patience_s=1.4)),
    # The robot seat leads: quick, strong, slow to give in; the other follows.
    "S02": (
        Habits(speed=49.0, effort=1.08, delay_steps=3, patience_s=2.5, impulsiveness=0.2),
        Habits(speed=46.0, effort=0.92, delay_steps=5, patience_s=0.5),
    ),
    # The human seat leads and likes to pass below.
    "S03": (
        Habits(speed=46.0, effort=0.92, delay_steps=5, patience_s=0.5),
        Habits(speed=49.0, effort=1.08, delay_steps=3, patience_s=2.5, left_bias=15.0),
    ),
    # Both impulsive, with opposite preferences and little patience.
    "S04": (
        Habits(impulsiveness=0.5, noise=0.12, left_bias=20.0, patience_s=0.7),
        Habits(impulsiveness=0.5, noise=0.12, left_bias=-20.0, patience_s=0.9, delay_steps=2),
    ),
    # Both careful: slow, steady, late to react, in agreement on the shorter way.
    "S05": (
        Habits(speed=44.0, noise=0.06, impulsiveness=0.2, delay_steps=6, route_temperature=60.0, patience_s=1.5),
        Habits(speed=45.0, noise=0.06, impulsiveness=0.2, delay_steps=5, route_temperature=60.0, patience_s=1.0),
    ),
}
"""Habits of five simulated pairs: (robot seat, human seat)."""

PARTNERS: dict[str, Habits] = {
    # Goes its own way, longer ones too, pulls hard and all but never gives in: come along, or both stand.
    "stubborn": Habits(effort=1.15, delay_steps=3, route_temperature=250.0, patience_s=60.0, impulsiveness=0.2),
    # Leaves most of the work and every decision to the other.
    "follower": Habits(speed=44.0, effort=0.5, delay_steps=5, patience_s=0.25, impulsiveness=0.3),
    # Goes at half the pace and takes a third of a second to react.
    "slow": Habits(speed=26.0, delay_steps=10, patience_s=2.0, noise=0.06, impulsiveness=0.2),
    # Pushes in bursts, wanders and slips, picks routes by whim and drops them as quickly.
    "erratic": Habits(noise=0.3, impulsiveness=0.9, slips_per_min=6.0, route_temperature=400.0, patience_s=0.4),
}
"""Habits by kind. They differ in what a robot has to cope with, not in skill: all see the map and know every way."""

NEVER_YIELDS = Habits(
    noise=0.0,
    impulsiveness=0.0,
    effort_drift=0.0,
    pauses_per_min=0.0,
    slips_per_min=0.0,
    delay_steps=2,
    patience_s=1e6,
)
"""A player who carries cleanly along its own route and has endless patience: the floor of a robot that never adapts."""

ROBOTS: dict[str, tuple[Habits, str]] = {
    "never-yields": (NEVER_YIELDS, "a clean scripted pilot with endless patience for its own route"),
    # What a policy that learned from simulated people could reach.
    "scripted": (Habits(), "a usual simulated pilot, who gives way: a reference, no floor"),
}
"""Scripted players for the robot seat of a study by name: habits, and what a result says of them."""
