"""Conversion of monotonic clock times to UTC."""

import time
from dataclasses import dataclass
from datetime import UTC, datetime


@dataclass(frozen=True)
class WallClockAnchor:
    """One moment on both clocks, taken once a session, so that corrections of the wall clock do not affect recordings.

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
        """A simulated clock that is zero at a UTC time, nanoseconds since 1970."""
        return cls(wall_ns, 0)

    def at(self, monotonic_ns: int) -> int:
        """UTC time, nanoseconds since 1970, of a time on the monotonic clock, ns."""
        return self.wall_ns + monotonic_ns - self.monotonic_ns

    def iso(self) -> str:
        """The moment as ISO 8601 text in UTC."""
        return datetime.fromtimestamp(self.wall_ns / 1e9, UTC).isoformat(timespec="milliseconds")
