"""How a simulated person carries: the habits in which players differ."""

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
