"""Five pairs of simulated players who carry differently."""

from .habits import Habits

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
