"""Calibrating a stick: let go of it, then turn it round."""

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from .calibration import DEAD_ZONES, StickCalibration

_REST_SAMPLES = 30  # a second
_SECTORS = 16
_ROUNDS = 2  # the first time round many do not reach the edge everywhere
_FAR = 0.5  # of an axis: nearer to the centre a stick is not turned round its edge
_RESTLESS = 0.35  # a stick that rests further off than this is being held


class CalibrationRun:
    """Collects readings of a stick at 30 Hz until they make a calibration.

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
