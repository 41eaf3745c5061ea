"""Timing of the real-time loop: ticks at a fixed rate, their lateness, and statistics of an episode."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from copolicy.dataset.task_spec import RECORD_HZ

DT_NS = 10**9 // RECORD_HZ
"""Length of a step at the default rate of tasks, ns."""

LATE_DIVISOR = 4
"""A step that begins more than 1 / `LATE_DIVISOR` of a step after its time is late."""

SLOW_LOOP = 1.25
"""An episode whose 99th percentile of periods exceeds this many steps is flagged."""


class MonotonicClock:
    """The machine's monotonic clock. A loop can use any object with these two methods as its clock."""

    def __call__(self) -> int:
        """The time, ns."""
        return time.monotonic_ns()

    def sleep(self, seconds: float) -> None:
        """Waits at least this long, s."""
        time.sleep(seconds)


@dataclass(frozen=True)
class Tick:
    """Times of one step on the monotonic clock.

    Attributes:
        scheduled_ns: when it was due.
        start_ns: when it began.
        skipped: ticks skipped before it, since the loop was behind by a whole tick or more.
    """

    scheduled_ns: int
    start_ns: int
    skipped: int

    @property
    def late_ns(self) -> int:
        """Delay of the step, ns."""
        return self.start_ns - self.scheduled_ns


class Ticker:
    """Ticks at the task's rate on the monotonic clock, without drift.

    A late tick starts as soon as possible and does not shift the next one. A loop that is behind by a whole tick or
    more does not catch up, which would need two steps for one reading of the sticks: the missed ticks are skipped and
    counted, and the simulation falls behind the wall clock by their length.

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
        """Starts the tick that is due, and schedules the next one."""
        start = self._clock()
        skipped = max(0, (start - self.due_ns) // self.dt_ns)
        scheduled = self.due_ns + skipped * self.dt_ns
        self.due_ns = scheduled + self.dt_ns
        return Tick(scheduled, start, skipped)


class LoopStatistics:
    """Timing of the loop over an episode, without its pauses."""

    def __init__(self, hz: int = RECORD_HZ):
        self._dt_ns = 10**9 // hz
        self._periods: list[int] = []
        self._last: Tick | None = None
        self.ticks = 0
        self.late = 0
        self.skipped = 0

    def add(self, tick: Tick) -> None:
        """Adds a tick."""
        if self._last is not None:
            self._periods.append(tick.start_ns - self._last.start_ns)
            self.skipped += tick.skipped
        self.late += tick.late_ns > self._dt_ns // LATE_DIVISOR
        self.ticks += 1
        self._last = tick

    def pause(self) -> None:
        """Marks a pause before the next tick, which is not counted as a period."""
        self._last = None

    @property
    def achieved_hz(self) -> float:
        """Achieved steps a second; nan before the second tick."""
        total = sum(self._periods)
        return len(self._periods) * 1e9 / total if total else float("nan")

    @property
    def slow(self) -> bool:
        """Whether a tick was skipped or the 99th percentile of the periods exceeds `SLOW_LOOP` steps."""
        return self.skipped > 0 or self.percentile_ms(99) > SLOW_LOOP * self._dt_ns / 1e6

    def percentile_ms(self, percent: float) -> float:
        """A percentile of the periods, ms; nan before the second tick."""
        return float(np.percentile(self._periods, percent)) / 1e6 if self._periods else float("nan")

    def summary(self) -> str:
        """The detail of the event `loop` in recordings, one line."""
        p50, p99, maximum = (self.percentile_ms(percent) for percent in (50, 99, 100))
        return f"period p50 {p50:.2f} p99 {p99:.2f} max {maximum:.2f} ms, late {self.late}, skipped {self.skipped}"
