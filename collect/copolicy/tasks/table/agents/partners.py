"""Kinds of simulated partners for the human seat, each with a will of its own, to judge a robot with."""

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError

from ..map_config import MapConfig
from .habits import Habits
from .scripted import ScriptedPilot

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


def simulated_partner(map_config: MapConfig, kind: str, seed: int, player: int = 1) -> ScriptedPilot:
    """A partner of a kind, by default at the human seat; equal seeds want the same route, whoever the other is.

    Raises:
        InvalidValueError: a negative seed or no such seat.
        UnknownNameError: no such kind.
    """
    if kind not in PARTNERS:
        raise UnknownNameError("kind of partner", kind, PARTNERS)
    if seed < 0:
        raise InvalidValueError("seed", "a whole number, not negative", seed)
    stream = np.random.SeedSequence([seed, *kind.encode()]).generate_state(1, np.uint64)[0]
    return ScriptedPilot(player, map_config, PARTNERS[kind], int(stream))
