"""The loop itself: a step a tick, whatever the players and the machine do."""

import time

import numpy as np
import pytest
from mcap.reader import make_reader
from play_session import SimulatedClock, on_short_map, settings

from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.rollout import Agent
from copolicy.collect.ticker import DT_NS
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput
from copolicy.dataset.recording.reader import read_episode

SCRIPTED = (PlayerSpec("scripted", "S01"), PlayerSpec("scripted", "S01"))


class Puller(Agent):
    """Pulls towards the goal; takes its time in some steps."""

    name = "puller"

    def __init__(self, slow_steps=(), seconds=0.0, sleep=time.sleep):
        self.step = 0
        self._slow, self._seconds, self._sleep = slow_steps, seconds, sleep

    def begin(self, seat, starts):
        self.step = 0

    def act(self, states, worlds):
        if self.step in self._slow:
            self._sleep(self._seconds)
        self.step += 1
        self.input = PlayerInput(axes=(float(self.step),))
        return np.array([[1.0, 0.0]])


def _play(tmp_path, first, second, clock=None, **changes):
    """One headless episode on the short map; returns its recording and its messages by topic."""
    with prepared(settings(tmp_path, players=SCRIPTED, episodes=1, **changes), clock=clock) as application:
        on_short_map(application)
        for player, agent in zip(application.game.players, (first, second), strict=True):
            player.agent = agent
        application.run()
        frames = application.frames
    (path,) = tmp_path.rglob("*.mcap")
    messages = {"/loop/timing": [], "/episode/event": [], "/player/0/input": []}
    kinds = {"/loop/timing": LoopTiming, "/episode/event": EpisodeEvent, "/player/0/input": PlayerInput}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(list(messages)):
            messages[channel.topic].append(kinds[channel.topic].FromString(message.data))
    return read_episode(path), messages, frames


def test_a_step_is_a_thirtieth_of_a_second(tmp_path):
    episode, messages, frames = _play(tmp_path, Puller(), Puller(), headless=True)
    timings = messages["/loop/timing"]
    assert episode.meta.success
    assert len(timings) == len(episode.actions)
    scheduled = np.array([message.scheduled_ns for message in timings])
    assert (
        scheduled[-1] - scheduled[0] == (len(timings) - 1 + sum(message.skipped_ticks for message in timings)) * DT_NS
    )
    assert [message.axes[0] for message in messages["/player/0/input"]] == list(range(1, len(timings) + 1))
    assert episode.meta.achieved_hz == pytest.approx(30, abs=1.0)
    assert all(message.work_ns > 0 for message in timings)
    assert frames == 0


def test_a_loop_that_falls_behind_skips_ticks_and_says_so(tmp_path):
    clock = SimulatedClock()
    slow = Puller(slow_steps=(20, 40), seconds=0.15, sleep=clock.sleep)
    episode, messages, _ = _play(tmp_path, slow, Puller(), clock, headless=True)
    timings = messages["/loop/timing"]
    # 150 ms are four ticks and a half: three are let go after each hold-up, none is caught up.
    skipped = {message.step: message.skipped_ticks for message in timings if message.skipped_ticks}
    assert skipped == {21: 3, 41: 3}
    assert np.diff([message.start_ns for message in timings]).min() > 0.2 * DT_NS
    assert "slow_loop" in episode.meta.quality_flags.split(",")
    assert episode.meta.achieved_hz < 29
    (loop,) = [event.detail for event in messages["/episode/event"] if event.kind == "loop"]
    assert f"skipped {sum(skipped.values())}" in loop
    # Each step has a reading of its own.
    assert [message.axes[0] for message in messages["/player/0/input"]] == list(range(1, len(timings) + 1))


def test_an_error_in_a_player_leaves_a_marked_recording(tmp_path):
    class Broken(Puller):
        def act(self, states, worlds):
            if self.step == 30:
                raise ZeroDivisionError("in the middle")
            return super().act(states, worlds)

    with pytest.raises(ZeroDivisionError, match="in the middle"):
        _play(tmp_path, Broken(), Puller(), SimulatedClock(), headless=True)
    (path,) = tmp_path.rglob("*.mcap")
    episode = read_episode(path)
    assert len(episode.actions) == 30
    assert episode.meta.termination_reason == "crash_recovered"
    assert episode.meta.quality_flags == "aborted"


def test_an_episode_that_is_stopped_before_its_first_step_is_complete(tmp_path):

    with prepared(settings(tmp_path, players=SCRIPTED, episodes=1, headless=True)) as application:
        on_short_map(application)
        game = application.game
        trial = game.next_trial()
        trial.begin(game.describe_devices(trial))
        game.end_trial("SIGTERM")
    (path,) = tmp_path.rglob("*.mcap")
    assert len(read_episode(path).actions) == 0


def test_pictures_are_drawn_between_the_steps(tmp_path):
    episode, messages, frames = _play(tmp_path, Puller(), Puller(), window=(400, 320))
    steps = len(episode.actions)
    # Twice a step where the machine has time; the steps come first.
    assert frames > 0.5 * steps
    assert len(messages["/loop/timing"]) == steps
