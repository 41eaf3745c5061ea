"""The times that the recording of an episode states."""

import pytest
from play_session import settings

from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.ticker import MonotonicClock, Tick
from copolicy.dataset.recording.reader import read_recording

DT_NS = 10**9 // 30


class HandClock(MonotonicClock):
    """A clock that the test moves on, ns."""

    now = 10**12

    def __call__(self) -> int:
        return self.now


def steps(trial, clock, count):
    for _ in range(count):
        trial.step(Tick(clock.now, clock.now, 0))
        clock.now += DT_NS


def pause(trial, clock, seconds):
    trial.pause("player")
    clock.now += round(seconds * 1e9)
    trial.resume()


@pytest.mark.parametrize("before_the_first_step", [0.0, 7.0])
def test_wall_time_is_without_pauses_also_before_the_first_step(tmp_path, before_the_first_step):
    clock = HandClock()
    players = (PlayerSpec("scripted", "S01"), PlayerSpec("scripted", "S02"))
    with prepared(settings(tmp_path, players=players, headless=True, window=None), clock=clock) as application:
        trial = application.game.next_trial()
        trial.begin({})
        clock.now += DT_NS
        if before_the_first_step:
            pause(trial, clock, before_the_first_step)
        steps(trial, clock, 9)
        pause(trial, clock, 2.0)
        steps(trial, clock, 3)
        trial.interrupt("operator_discard", "test")
    (duration,) = [event.detail for event in read_recording(trial.path).events if event.kind == "duration"]
    assert duration == "simulated 0.400 s, wall 0.400 s, paused 2.000 s"
