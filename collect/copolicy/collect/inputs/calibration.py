"""From what a stick says to a force: centre, range, dead zone, inversion."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError

Pair = tuple[float, float]

DEAD_ZONES = (0.05, 0.30)
"""Smallest and largest dead zone that can be set, share of the full deflection."""


@dataclass(frozen=True)
class StickCalibration:
    """How one kind of device turns its axes into a force.

    Attributes:
        axes: which two axes are x (right) and y (down).
        centre: what they say at rest.
        low: their smallest value.
        high: their largest value.
        dead_zone: deflection below which there is no force, share of the full one.
        invert: turn x, y round.
        measured: centre and range are those of a device; False for values that suit most.
    """

    axes: tuple[int, int] = (0, 1)
    centre: Pair = (0.0, 0.0)
    low: Pair = (-1.0, -1.0)
    high: Pair = (1.0, 1.0)
    dead_zone: float = 0.12
    invert: tuple[bool, bool] = (False, False)
    measured: bool = field(default=True, compare=False)

    def __post_init__(self):
        for name in ("axes", "centre", "low", "high", "invert"):
            values = tuple(getattr(self, name))
            if len(values) != 2 or not all(isinstance(v, (int, float)) and math.isfinite(v) for v in values):
                raise InvalidValueError(f"calibration {name}", "two finite numbers", values)
            object.__setattr__(self, name, values)
        if any(axis < 0 or int(axis) != axis for axis in self.axes):
            raise InvalidValueError("calibration axes", "two numbers of axes, from 0", self.axes)
        if not all(a < b < c for a, b, c in zip(self.low, self.centre, self.high, strict=True)):
            raise InvalidValueError("calibration", "low < centre < high", (self.low, self.centre, self.high))
        if not 0 <= self.dead_zone < 1:
            raise InvalidValueError("calibration dead_zone", "a share in [0, 1)", self.dead_zone)

    def force(self, axes: Sequence[float]) -> Pair:
        """The force of a reading, each component in [-1, 1]; axes that the device does not have count as zero.

        The dead zone is a disc, not a cross: beyond it the force grows from zero in the direction of the stick.
        """
        deflection = []
        for k in range(2):
            index = self.axes[k]
            value = (axes[index] if index < len(axes) else 0.0) - self.centre[k]
            value /= self.high[k] - self.centre[k] if value > 0 else self.centre[k] - self.low[k]
            deflection.append(-value if self.invert[k] else value)
        size = math.hypot(*deflection)
        if size <= self.dead_zone:
            return 0.0, 0.0
        gain = (size - self.dead_zone) / (1 - self.dead_zone) / size
        x, y = (min(1.0, max(-1.0, gain * value)) for value in deflection)
        return x, y

    def to_json(self) -> dict[str, Any]:
        """As JSON-able entries."""
        return asdict(self)

    @classmethod
    def from_json(cls, entries: Any) -> "StickCalibration":
        """The inverse of `to_json`.

        Raises:
            InvalidValueError: other entries, or values that make no calibration.
        """
        names = set(cls.__dataclass_fields__) - {"measured"}
        if not isinstance(entries, dict) or set(entries) - {"measured"} != names:
            raise InvalidValueError("calibration", f"the entries {sorted(names)}", entries)
        if not isinstance(entries.get("measured", True), bool):
            raise InvalidValueError("calibration measured", "true or false", entries["measured"])
        try:
            read = cls(**entries)
        except (TypeError, ValueError, IndexError):
            raise InvalidValueError("calibration", "numbers", entries) from None
        usual = cls()
        if "measured" not in entries and (read.centre, read.low, read.high) == (usual.centre, usual.low, usual.high):
            # Files did not say it before; nobody measures exactly these.
            return replace(read, measured=False)
        return read
