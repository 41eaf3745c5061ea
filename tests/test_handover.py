"""Co-planning that goes on from a demonstration, a benchmark."""

import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from policy_runs import save_run

from copolicy.collect.episodes import run_episodes
from copolicy.dataset.episode import Episode
from copolicy.dataset.features import STATE
from copolicy.train.checkpoint import Checkpoint

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import handover  # pyright: ignore[reportMissingImports]


@pytest.fixture
def demonstration() -> Episode:
    """A simulated pair that carries the table from 240 px to beyond 900 px."""
    return run_episodes("scripted:S01", "scripted:S01", limit=1)[0]


@pytest.fixture
def policy(tmp_path) -> Checkpoint:
    """Untrained, 10 Hz: a frame is three steps."""
    return Checkpoint(save_run(tmp_path / "run", "bc_lstm_gmm"))


def test_a_policy_goes_on_from_a_demonstration_that_it_has_observed(demonstration, policy, monkeypatch):
    observed: list[Any] = []
    predict = policy.predict_action_chunk
    monkeypatch.setattr(policy, "predict_action_chunk", lambda frames: observed.append(frames) or predict(frames))
    (continued,) = handover.continued(policy, [demonstration], 480.0)
    steps = int(np.argmax(demonstration.states[:, 0] >= 480.0))
    assert steps > 100
    assert np.array_equal(continued.states[: steps + 1], demonstration.states[: steps + 1])
    assert np.array_equal(continued.actions[:steps], demonstration.actions[:steps])
    assert not np.array_equal(continued.actions[steps], demonstration.actions[steps])
    states = np.concatenate([frames[STATE][:, -1, :2] for frames in observed])
    assert len(states) > steps // 3
    assert np.allclose(states[: steps // 3 + 1], demonstration.states[: steps + 1 : 3, :2])


def test_beside_it_the_policy_acts_from_the_start(demonstration, policy):
    (own,) = handover.continued(policy, [demonstration], 0.0)
    assert not np.array_equal(own.actions[0], demonstration.actions[0])


def test_a_hand_over_that_no_recording_reaches_and_another_world_are_refused(demonstration, policy):
    with pytest.raises(SystemExit, match="the table comes to x = 5000 px, found one without"):
        handover.continued(policy, [demonstration], 5000.0)
    heavier = replace(demonstration, settings=replace(demonstration.settings, mass=3.0))
    with pytest.raises(SystemExit, match="found one with other settings"):
        handover.continued(policy, [heavier], 480.0)


OBSTACLE = "collision_obstacle"


@pytest.mark.parametrize(
    ("end", "reason", "at_480", "at_720"),
    [
        ((400.0, 300.0), OBSTACLE, (1, 1), (0, 0)),
        ((560.0, 300.0), OBSTACLE, (1, 1), (0, 1)),  # with its rear end
        ((640.0, 200.0), OBSTACLE, (0, 1), (1, 1)),
        ((640.0, 580.0), "collision_wall", (0, 1), (0, 1)),
        ((900.0, 300.0), "goal", (0, 1), (0, 1)),
    ],
)
def test_an_episode_counts_at_the_column_of_the_obstacle_that_ended_it(end, reason, at_480, at_720):
    path = np.linspace((240.0, 300.0), end, 50)
    episode: Any = SimpleNamespace(
        states=path[:-1],
        final_state=path[-1],
        meta=SimpleNamespace(termination_reason=reason),
        scenario=SimpleNamespace(obstacles=((480.0, 300.0), (720.0, 180.0))),
    )
    assert handover.touched([episode], 480, 0.0) == at_480
    assert handover.touched([episode], 720, 540.0) == at_720
    episode.scenario.obstacles = episode.scenario.obstacles[1:]
    assert handover.touched([episode], 480, 0.0) == (0, 0)
