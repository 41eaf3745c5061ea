"""The beat of the real-time loop: when the next step is due, how late it came, and how well an episode kept time."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

DT_NS = 10**9 // RECORD_HZ
"""Length of a step at the rate that tasks have by default, ns."""

LATE = 4
"""A step that begins later than a quarter of one after its time counts as late."""

SLOW_LOOP = 1.25
"""An episode whose 99th percentile of periods exceeds this many steps is flagged."""


class MonotonicClock:
    """The machine's clock that never goes back. A loop follows any clock with these two methods."""

    def __call__(self) -> int:
        """The time, ns."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Waits; longer where the machine is busy."""
        time.sleep(seconds)


@dataclass(frozen=True)
class Tick:
    """One step's time, all on the monotonic clock.

    Attributes:
        scheduled_ns: when it was due.
        start_ns: when it began.
        skipped: ticks before it that were let go, since the loop had fallen behind by more than one.
    """

    scheduled_ns: int
    start_ns: int
    skipped: int

    @property
    def late_ns(self) -> int:
        """How much too late it began."""
        return self.start_ns - self.scheduled_ns


class Ticker:
    """The task's ticks a second of the monotonic clock, for any length of time without drift.

    A tick that comes late is taken as soon as possible, and the next keeps its own time. A loop that is behind by a
    whole tick or more never catches up with two steps on one reading of the sticks: the ticks it missed are let go
    and counted, and the simulation runs behind the wall clock by so much.

    Attributes:
        dt_ns: length of a step, ns.
        due_ns: when the next tick is due.
    """

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns, hz: int = RECORD_HZ):
        self.dt_ns = 10**9 // hz
        self._clock = clock
        self.restart()

    def restart(self, delay_ns: int = 0) -> None:
        """Makes the next tick due now, or after a delay."""
        self.due_ns = self._clock() + delay_ns

    def remaining_ns(self) -> int:
        """Time until the next tick; negative once it is due."""
        return self.due_ns - self._clock()

    def tick(self) -> Tick:
        """Takes the tick that is due."""
        start = self._clock()
        skipped = max(0, (start - self.due_ns) // self.dt_ns)
        scheduled = self.due_ns + skipped * self.dt_ns
        self.due_ns = scheduled + self.dt_ns
        return Tick(scheduled, start, skipped)


class LoopStatistics:
    """How well the loop kept its time over an episode, its pauses left out."""

    def __init__(self, hz: int = RECORD_HZ):
        self._dt_ns = 10**9 // hz
        self._periods: list[int] = []
        self._last: Tick | None = None
        self.ticks = 0
        self.late = 0
        self.skipped = 0

    def add(self, tick: Tick) -> None:
        """Takes a tick."""
        if self._last is not None:
            self._periods.append(tick.start_ns - self._last.start_ns)
            self.skipped += tick.skipped
        self.late += tick.late_ns > self._dt_ns // LATE
        self.ticks += 1
        self._last = tick

    def pause(self) -> None:
        """The next tick comes after a pause: what lies between is no period."""
        self._last = None

    @property
    def achieved_hz(self) -> float:
        """Steps a second; nan before the second one."""
        total = sum(self._periods)
        return len(self._periods) * 1e9 / total if total else float("nan")

    @property
    def slow(self) -> bool:
        """The episode is to be flagged: a tick was skipped, or periods were too long too often."""
        return self.skipped > 0 or self.percentile_ms(99) > SLOW_LOOP * self._dt_ns / 1e6

    def percentile_ms(self, percent: float) -> float:
        """A percentile of the periods, ms; nan before the second tick."""
        return float(np.percentile(self._periods, percent)) / 1e6 if self._periods else float("nan")

    def summary(self) -> str:
        """One line, as it stands in the event `loop` of a recording."""
        p50, p99, most = (self.percentile_ms(percent) for percent in (50, 99, 100))
        return f"period p50 {p50:.2f} p99 {p99:.2f} max {most:.2f} ms, late {self.late}, skipped {self.skipped}"
