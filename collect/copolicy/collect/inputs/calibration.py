"""Stick calibration: centre, range, dead zone and inversion turn a reading into a force."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from statistics import median
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError

Pair = tuple[float, float]

DEAD_ZONES = (0.05, 0.30)
"""Smallest and largest dead zone that can be set, as a proportion of full deflection."""


@dataclass(frozen=True)
class StickCalibration:
    """The calibration of one device model.

    Attributes:
        axes: indices of x (right) and y (down).
        centre: values of x, y at rest.
        low: their smallest values.
        high: their largest values.
        dead_zone: deflection below which the force is zero, as a proportion of full deflection.
        invert: reverse x, y.
        measured: centre and range were measured on a device; False for default values.
    """

    axes: tuple[int, int] = (0, 1)
    centre: Pair = (0.0, 0.0)
    low: Pair = (-1.0, -1.0)
    high: Pair = (1.0, 1.0)
    dead_zone: float = 0.12
    invert: tuple[bool, bool] = (False, False)
    measured: bool = field(default=True, compare=False)

    def __post_init__(self) -> None:
        for name in ("axes", "centre", "low", "high", "invert"):
            values = tuple(getattr(self, name))
            if len(values) != 2 or not all(isinstance(v, (int, float)) and math.isfinite(v) for v in values):
                raise InvalidValueError(f"calibration {name}", "two finite numbers", values)
            object.__setattr__(self, name, values)
        if any(axis < 0 or int(axis) != axis for axis in self.axes):
            raise InvalidValueError("calibration axes", "two axis indices, from 0", self.axes)
        if not all(a < b < c for a, b, c in zip(self.low, self.centre, self.high, strict=True)):
            raise InvalidValueError("calibration", "low < centre < high", (self.low, self.centre, self.high))
        if not 0 <= self.dead_zone < 1:
            raise InvalidValueError("calibration dead_zone", "a proportion in [0, 1)", self.dead_zone)

    def force(self, axes: Sequence[float]) -> Pair:
        """Returns the force of a reading, each component in [-1, 1]; axes that the device lacks count as zero.

        The dead zone is a disc, not a cross: outside it the force grows from zero in the direction of the stick.
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
        """Returns the fields as JSON-able entries."""
        return asdict(self)

    @classmethod
    def from_json(cls, entries: Any) -> "StickCalibration":
        """The inverse of `to_json`.

        Raises:
            InvalidValueError: the entries differ from the fields, or a value is invalid.
        """
        names = set(cls.__dataclass_fields__) - {"measured"}
        if not isinstance(entries, dict) or set(entries) - {"measured"} != names:
            raise InvalidValueError("calibration", f"the entries {sorted(names)}", entries)
        if not isinstance(entries.get("measured", True), bool):
            raise InvalidValueError("calibration measured", "true or false", entries["measured"])
        try:
            calibration = cls(**entries)
        except (TypeError, ValueError, IndexError):
            raise InvalidValueError("calibration", "numbers", entries) from None
        ranges = ("centre", "low", "high")
        if "measured" not in entries and all(getattr(calibration, name) == getattr(cls(), name) for name in ranges):
            # Older files lack the entry; no measurement gives exactly the defaults.
            return replace(calibration, measured=False)
        return calibration


_REST_SAMPLES = 30  # one second at the default rate of a task
_SECTORS = 16
_ROUNDS = 2  # in the first round many people miss the edge in some directions
_MIN_RADIUS = 0.5  # axis units; closer to the centre, the stick is not at its edge
_MAX_REST_OFFSET = 0.35  # axis units; beyond it, somebody holds the stick


class CalibrationRun:
    """Measures a calibration from stick readings, one a tick.

    First the stick must rest for a second (gives its centre and noise), then it is turned around its edge twice
    (gives its range).

    Attributes:
        stage: `rest`, `turn` or `done`.
    """

    def __init__(self, before: StickCalibration):
        self._before = before
        self._rest: list[tuple[float, float]] = []
        self._turn: list[tuple[float, float]] = []
        self._visits = [0] * _SECTORS
        self._sector = -1
        self.stage = "rest"

    @property
    def progress(self) -> float:
        """Proportion of the current stage that is done, in [0, 1]."""
        if self.stage == "rest":
            return len(self._rest) / _REST_SAMPLES
        return sum(self._visits) / (_ROUNDS * _SECTORS) if self.stage == "turn" else 1.0

    def add(self, axes: Sequence[float]) -> None:
        """Adds a reading."""
        x, y = (axes[index] if index < len(axes) else 0.0 for index in self._before.axes)
        if self.stage == "rest":
            if math.hypot(x, y) > _MAX_REST_OFFSET or (self._rest and math.dist((x, y), self._rest[0]) > 0.1):
                self._rest.clear()
                return
            self._rest.append((x, y))
            if len(self._rest) == _REST_SAMPLES:
                self.stage = "turn"
        elif self.stage == "turn":
            self._turn.append((x, y))
            centre_x, centre_y = self._centre
            if math.hypot(x - centre_x, y - centre_y) > _MIN_RADIUS:
                angle = math.atan2(y - centre_y, x - centre_x) % (2 * math.pi)
                sector = int(angle / (2 * math.pi) * _SECTORS) % _SECTORS
                if sector != self._sector:
                    self._sector = sector
                    self._visits[sector] = min(_ROUNDS, self._visits[sector] + 1)
            if sum(self._visits) == _ROUNDS * _SECTORS:
                self.stage = "done"

    def result(self) -> StickCalibration:
        """Returns the calibration once `stage` is `done`; axes and inversion are unchanged."""
        centre = self._centre
        noise = max(math.hypot(x - centre[0], y - centre[1]) for x, y in self._rest)
        xs, ys = zip(*self._turn, strict=True)
        low, high = (min(xs), min(ys)), (max(xs), max(ys))
        reach = min(b - a for a, b in zip(low, high, strict=True)) / 2
        smallest, largest = DEAD_ZONES
        return replace(
            self._before,
            centre=centre,
            low=low,
            high=high,
            dead_zone=round(min(largest, max(smallest, 0.10, 2 * noise / reach)), 3),
            measured=True,
        )

    @property
    def _centre(self) -> tuple[float, float]:
        xs, ys = zip(*self._rest, strict=True)
        return median(xs), median(ys)
