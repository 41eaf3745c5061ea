"""How much actions depend on the velocity and the place, a benchmark."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from policy_runs import save_run

from copolicy.dataset import DatasetEpisode, load_dataset
from copolicy.train.checkpoint import Checkpoint

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import sensitivity  # pyright: ignore[reportMissingImports]


@pytest.fixture
def episodes(sound, sound_recordings):
    """The beginnings of three, of different lengths."""
    first = list(load_dataset(sound_recordings.parent / "set").episodes)[:3]
    return [beginning(episode, frames) for episode, frames in zip(first, (20, 12, 16), strict=True)]


def beginning(episode: DatasetEpisode, frames: int) -> DatasetEpisode:
    arrays = ("states", "actions", "past_human_actions", "rewards")
    return replace(episode, **{name: getattr(episode, name)[:frames] for name in arrays})


def test_a_change_of_the_state_is_that_alone():
    states = np.array([[300.0, 200.0, 1.0, 0.0, 20.0, -10.0, 0.5]])
    assert sensitivity.without_velocity(states).tolist() == [[300, 200, 1, 0, 0, 0, 0]]
    assert sensitivity.moved(states).tolist() == [[300, 220, 1, 0, 20, -10, 0.5]]
    assert np.allclose(sensitivity.turned(states), [[300, 200, 3**0.5 / 2, 0.5, 20, -10, 0.5]])
    assert states.tolist() == [[300, 200, 1, 0, 20, -10, 0.5]]


@pytest.mark.parametrize("kind", ["bc_lstm_gmm", "copolicy"])
def test_each_frame_of_each_episode_has_the_action_of_its_history(kind, episodes, tmp_path):
    policy = Checkpoint(save_run(tmp_path / "run", kind))
    together = sensitivity.predicted(policy, episodes, np.copy)
    assert together.shape == (sum(len(episode) for episode in episodes), 4)
    if kind == "bc_lstm_gmm":
        policy.policy.config.execution_deviation = 0.0
        torch.nn.init.constant_(policy.policy.network.logits.bias[0], 1e4)  # one mode: no random numbers
        together = sensitivity.predicted(policy, episodes, np.copy)
        alone = np.concatenate([sensitivity.predicted(policy, [episode], np.copy) for episode in episodes])
        assert np.allclose(together, alone, atol=1e-5)
    assert np.array_equal(together, sensitivity.predicted(policy, episodes, np.copy))
    assert np.abs(together - sensitivity.predicted(policy, episodes, sensitivity.moved)).max() > 1e-6


def test_a_policy_that_does_not_see_the_velocity_does_not_depend_on_it(episodes, tmp_path):
    hidden = {"hidden_state": ["vx", "vy", "omega"]}
    for settings, depends in (({}, True), (hidden, False)):
        policy = Checkpoint(save_run(tmp_path / f"run{depends}", "bc_lstm_gmm"), settings=settings)
        changes = [
            sensitivity.predicted(policy, episodes, change) for change in (np.copy, sensitivity.without_velocity)
        ]
        assert np.array_equal(*changes) != depends
