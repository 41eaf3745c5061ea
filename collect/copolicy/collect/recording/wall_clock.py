"""Puts times of the monotonic clock on the calendar."""

import time
from dataclasses import dataclass
from datetime import UTC, datetime


@dataclass(frozen=True)
class WallClockAnchor:
    """One moment read on both clocks; a session takes it once, so that a corrected wall clock never bends a recording.

    Attributes:
        wall_ns: UTC, nanoseconds since 1970.
        monotonic_ns: the same moment on the monotonic clock (0 where the time is simulated).
    """

    wall_ns: int
    monotonic_ns: int

    @classmethod
    def now(cls) -> "WallClockAnchor":
        """The present moment."""
        return cls(time.time_ns(), time.monotonic_ns())

    @classmethod
    def simulated(cls, wall_ns: int) -> "WallClockAnchor":
        """A simulated clock that starts at zero at a moment of the calendar."""
        return cls(wall_ns, 0)

    def at(self, monotonic_ns: int) -> int:
        """Nanoseconds since 1970, UTC, of a moment on the monotonic clock."""
        return self.wall_ns + monotonic_ns - self.monotonic_ns

    def iso(self) -> str:
        """The moment as ISO 8601 text in UTC."""
        return datetime.fromtimestamp(self.wall_ns / 1e9, UTC).isoformat(timespec="milliseconds")
