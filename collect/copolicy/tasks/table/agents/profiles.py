"""Profiles of scripted players: of five simulated pairs, of kinds of partner in studies, and of scripted robots."""

import math
from dataclasses import dataclass, fields

from copolicy.dataset.exceptions import InvalidValueError


@dataclass(frozen=True)
class PlayerProfile:
    """Parameters of one scripted player."""

    speed: float = 48.0
    """Target speed on a free path, px/s; two full forces reach 50."""
    effort: float = 1.0
    """Factor on its half of the joint force: above 1 it leads, below 1 it leaves work to the partner."""
    delay_steps: int = 4
    """Reaction time, steps of 1/30 s: it acts on the state of so many steps ago."""
    noise: float = 0.1
    """Standard deviation of the additive noise (Ornstein-Uhlenbeck, 0.5 s), of a full force."""
    impulsiveness: float = 0.4
    """It applies its force in pulses of about 1 s; each is weaker by up to this proportion. 0 is steady."""
    effort_drift: float = 0.2
    """Standard deviation of the logarithm of its effort, which drifts over some seconds, so that the leader changes."""
    pauses_per_min: float = 2.0
    """Rate of pauses of 0.4 to 1.2 s."""
    slips_per_min: float = 1.0
    """Rate of slips: forces in a random direction for 0.2 to 0.5 s, of 0.4 to 0.9 of a full force."""
    route_temperature: float = 90.0
    """Temperature of the softmax over route lengths, px: a route that is longer by so much is e times less likely."""
    left_bias: float = 0.0
    """Detour that it accepts to pass one obstacle on side L (below it, when going right), px; negative for R."""
    patience_s: float = 1.0
    """Time until it gives up its route while the partner pulls towards another one, s."""
    clearance: float = 1.7
    """Factor on the distance it keeps from obstacles: 1 passes closely, people 1.6 to 1.8, 2.6 is wider than people."""

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            value = getattr(self, name)
            if not math.isfinite(value) or (value < 0 and name != "left_bias"):
                raise InvalidValueError(f"PlayerProfile.{name}", "a finite number, not negative", value)
        for name in ("speed", "route_temperature", "clearance"):
            if not getattr(self, name) > 0:
                raise InvalidValueError(f"PlayerProfile.{name}", "a positive number", getattr(self, name))
        if not isinstance(self.delay_steps, int):
            raise InvalidValueError("PlayerProfile.delay_steps", "a whole number", self.delay_steps)
        if self.impulsiveness > 1:
            raise InvalidValueError("PlayerProfile.impulsiveness", "at most 1", self.impulsiveness)


PAIRS: dict[str, tuple[PlayerProfile, PlayerProfile]] = {
    # Two of the same kind.
    "S01": (PlayerProfile(), PlayerProfile(delay_steps=3, patience_s=1.4)),
    # The robot's seat leads: fast, strong, slow to yield; the human's follows.
    "S02": (
        PlayerProfile(speed=49.0, effort=1.08, delay_steps=3, patience_s=2.5, impulsiveness=0.2),
        PlayerProfile(speed=46.0, effort=0.92, delay_steps=5, patience_s=0.5),
    ),
    # The human's seat leads and prefers to pass below.
    "S03": (
        PlayerProfile(speed=46.0, effort=0.92, delay_steps=5, patience_s=0.5),
        PlayerProfile(speed=49.0, effort=1.08, delay_steps=3, patience_s=2.5, left_bias=15.0),
    ),
    # Both impulsive, with opposite preferences and little patience.
    "S04": (
        PlayerProfile(impulsiveness=0.5, noise=0.12, left_bias=20.0, patience_s=0.7),
        PlayerProfile(impulsiveness=0.5, noise=0.12, left_bias=-20.0, patience_s=0.9, delay_steps=2),
    ),
    # Both careful: slow, steady, late to react, mostly on the shorter route.
    "S05": (
        PlayerProfile(speed=44.0, noise=0.06, impulsiveness=0.2, delay_steps=6, route_temperature=60.0, patience_s=1.5),
        PlayerProfile(speed=45.0, noise=0.06, impulsiveness=0.2, delay_steps=5, route_temperature=60.0, patience_s=1.0),
    ),
}
"""Profiles of five simulated pairs: (robot's seat, human's seat)."""

PARTNERS: dict[str, PlayerProfile] = {
    # Follows its own route, even a longer one, with a strong force, and hardly ever yields.
    "stubborn": PlayerProfile(effort=1.15, delay_steps=3, route_temperature=250.0, patience_s=60.0, impulsiveness=0.2),
    # Leaves most of the work and the choice of route to the partner.
    "follower": PlayerProfile(speed=44.0, effort=0.5, delay_steps=5, patience_s=0.25, impulsiveness=0.3),
    # Half the speed, and a reaction time of a third of a second.
    "slow": PlayerProfile(speed=26.0, delay_steps=10, patience_s=2.0, noise=0.06, impulsiveness=0.2),
    # Strong pulses, noise and slips; chooses routes almost at random and changes them soon.
    "erratic": PlayerProfile(noise=0.3, impulsiveness=0.9, slips_per_min=6.0, route_temperature=400.0, patience_s=0.4),
}
"""Profiles by kind of partner. All know the map and every route; they differ in what a robot must adapt to."""

NEVER_YIELDS = PlayerProfile(
    noise=0.0,
    impulsiveness=0.0,
    effort_drift=0.0,
    pauses_per_min=0.0,
    slips_per_min=0.0,
    delay_steps=2,
    patience_s=1e6,
)
"""A player without motor noise that never changes its route: the lower reference of a robot that does not adapt."""

ROBOTS: dict[str, tuple[PlayerProfile, str]] = {
    "never-yields": (NEVER_YIELDS, "a scripted agent without motor noise that never changes its route"),
    # What a policy that learned from simulated people could reach.
    "scripted": (
        PlayerProfile(),
        "a scripted agent of the usual profile, which yields: a reference, not a lower bound",
    ),
}
"""Scripted players for the robot's seat of a study, by name: profile, and description for results."""
