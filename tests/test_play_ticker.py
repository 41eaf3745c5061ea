import math

import pytest

from copolicy.collect.ticker import DT_NS, LATE_DIVISOR, LoopStatistics, Tick, Ticker


class Clock:
    """Time that passes only when a test says so."""

    def __init__(self):
        self.now = 10**12

    def __call__(self) -> int:
        return self.now


def _run(clock, ticker, delays):
    """Takes one tick a delay (ns after it was due)."""
    ticks = []
    for delay in delays:
        clock.now = max(clock.now, ticker.due_ns + delay)
        ticks.append(ticker.tick())
    return ticks


def test_ticks_keep_their_beat_for_hours():
    clock = Clock()
    ticker = Ticker(clock)
    ticks = _run(clock, ticker, [0] * 200_000)
    assert ticks[-1].scheduled_ns - ticks[0].scheduled_ns == 199_999 * DT_NS
    assert {tick.late_ns for tick in ticks} == {0}


def test_a_late_tick_does_not_move_the_next():
    clock = Clock()
    ticker = Ticker(clock)
    first, late, after = _run(clock, ticker, [0, DT_NS // 2, 0])
    assert (late.late_ns, late.skipped) == (DT_NS // 2, 0)
    assert after.scheduled_ns == first.scheduled_ns + 2 * DT_NS
    assert after.start_ns - late.start_ns == pytest.approx(DT_NS / 2, abs=1)


@pytest.mark.parametrize(("behind", "skipped"), [(0.99, 0), (1.0, 1), (1.5, 1), (7.2, 7)])
def test_a_loop_that_is_behind_lets_ticks_go(behind, skipped):
    clock = Clock()
    ticker = Ticker(clock)
    _, late, after = _run(clock, ticker, [0, round(behind * DT_NS) + 1, 0])
    assert late.skipped == skipped
    assert 0 <= late.late_ns < DT_NS
    # Never two steps at once: the next tick is due in the future of the late one.
    assert after.start_ns > late.start_ns
    assert after.scheduled_ns == late.scheduled_ns + DT_NS


def test_the_statistics_of_a_steady_loop():
    loop = LoopStatistics()
    for k in range(300):
        loop.add(Tick(k * DT_NS, k * DT_NS, 0))
    assert loop.achieved_hz == pytest.approx(30.0)
    assert (loop.late, loop.skipped, loop.slow) == (0, 0, False)
    assert loop.summary() == "period p50 33.33 p99 33.33 max 33.33 ms, late 0, skipped 0"


@pytest.mark.parametrize(("hiccups", "slow"), [(1, False), (4, True)])
def test_an_episode_is_judged_by_its_99th_percentile(hiccups, slow):
    loop = LoopStatistics()
    late = DT_NS // LATE_DIVISOR + 10**6
    for k in range(200):
        delay = late if k % 40 == 20 and k // 40 < hiccups else 0
        loop.add(Tick(k * DT_NS, k * DT_NS + delay, 0))
    assert loop.late == hiccups
    assert loop.slow is slow


def test_one_skipped_tick_is_enough_to_flag_an_episode():
    loop = LoopStatistics()
    for k in range(1000):
        loop.add(Tick(k * DT_NS, k * DT_NS, 0))
    loop.add(Tick(1001 * DT_NS, 1001 * DT_NS, 1))
    assert loop.skipped == 1
    assert loop.slow


def test_a_pause_is_no_period():
    loop = LoopStatistics()
    loop.add(Tick(0, 0, 0))
    loop.add(Tick(DT_NS, DT_NS, 0))
    loop.pause()
    loop.add(Tick(10**11, 10**11, 2000))
    loop.add(Tick(10**11 + DT_NS, 10**11 + DT_NS, 0))
    assert loop.achieved_hz == pytest.approx(30.0)
    assert loop.skipped == 0
    assert not loop.slow


def test_an_episode_of_one_step_has_no_rate():
    loop = LoopStatistics()
    loop.add(Tick(0, 0, 0))
    assert math.isnan(loop.achieved_hz)
    assert not loop.slow
