"""From what a stick says to a force: centre, range, dead zone, inversion."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from statistics import median
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


_REST_SAMPLES = 30  # a second at the rate that tasks have by default
_SECTORS = 16
_ROUNDS = 2  # the first time round many do not reach the edge everywhere
_FAR = 0.5  # of an axis: nearer to the centre a stick is not turned round its edge
_RESTLESS = 0.35  # a stick that rests further off than this is being held


class CalibrationRun:
    """Collects readings of a stick, one a tick, until they make a calibration.

    First the stick must be left alone for a second (its centre, and how much it trembles), then turned round its
    edge twice (its range).

    Attributes:
        stage: `rest`, `turn` or `done`.
    """

    def __init__(self, before: StickCalibration):
        self._before = before
        self._rest: list[tuple[float, float]] = []
        self._seen: list[tuple[float, float]] = []
        self._visits = [0] * _SECTORS
        self._sector = -1
        self.stage = "rest"

    @property
    def progress(self) -> float:
        """Share of the present stage that is done."""
        if self.stage == "rest":
            return len(self._rest) / _REST_SAMPLES
        return sum(self._visits) / (_ROUNDS * _SECTORS) if self.stage == "turn" else 1.0

    def add(self, axes: Sequence[float]) -> None:
        """Takes a reading."""
        x, y = (axes[index] if index < len(axes) else 0.0 for index in self._before.axes)
        if self.stage == "rest":
            if (self._rest and math.hypot(x - self._rest[0][0], y - self._rest[0][1]) > 0.1) or math.hypot(
                x, y
            ) > _RESTLESS:
                self._rest.clear()
                return
            self._rest.append((x, y))
            if len(self._rest) == _REST_SAMPLES:
                self.stage = "turn"
        elif self.stage == "turn":
            self._seen.append((x, y))
            centre_x, centre_y = self._centre
            if math.hypot(x - centre_x, y - centre_y) > _FAR:
                angle = math.atan2(y - centre_y, x - centre_x) % (2 * math.pi)
                sector = int(angle / (2 * math.pi) * _SECTORS) % _SECTORS
                if sector != self._sector:
                    self._sector = sector
                    self._visits[sector] = min(_ROUNDS, self._visits[sector] + 1)
            if sum(self._visits) == _ROUNDS * _SECTORS:
                self.stage = "done"

    def result(self) -> StickCalibration:
        """The calibration, once `stage` is `done`; inversion stays as it was."""
        centre = self._centre
        tremble = max(math.hypot(x - centre[0], y - centre[1]) for x, y in self._rest)
        xs, ys = zip(*self._seen, strict=True)
        low, high = (min(xs), min(ys)), (max(xs), max(ys))
        reach = min(b - a for a, b in zip(low, high, strict=True)) / 2
        smallest, largest = DEAD_ZONES
        return replace(
            self._before,
            centre=centre,
            low=low,
            high=high,
            dead_zone=round(min(largest, max(smallest, 0.10, 2 * tremble / reach)), 3),
            measured=True,
        )

    @property
    def _centre(self) -> tuple[float, float]:
        xs, ys = zip(*self._rest, strict=True)
        return median(xs), median(ys)
