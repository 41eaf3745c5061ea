"""How much actions depend on the velocity and the place, a benchmark."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from policy_runs import save_run

from copolicy.dataset import DatasetEpisode, load_dataset
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
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
    assert sensitivity.resting_states(states).tolist() == [[300, 200, 1, 0, 0, 0, 0]]
    assert sensitivity.shifted_states(states).tolist() == [[300, 220, 1, 0, 20, -10, 0.5]]
    assert np.allclose(sensitivity.turned_states(states), [[300, 200, 3**0.5 / 2, 0.5, 20, -10, 0.5]])
    assert states.tolist() == [[300, 200, 1, 0, 20, -10, 0.5]]


def without_random_numbers(folder: Path, kind: str) -> Checkpoint:
    """An untrained policy that draws neither noise nor modes."""
    if kind == "copolicy":
        return Checkpoint(save_run(folder, kind), settings={"initial_noise_scale": 0.0})
    policy = Checkpoint(save_run(folder, kind), settings={"execution_deviation": 0.0})
    torch.nn.init.constant_(policy.policy.network.logits.bias[0], 1e4)
    return policy


@pytest.mark.parametrize("kind", ["bc_lstm_gmm", "copolicy"])
def test_each_frame_of_each_episode_has_the_action_of_its_history(kind, episodes, tmp_path):
    policy = without_random_numbers(tmp_path / "run", kind)
    together = sensitivity.predicted_actions(policy, episodes, np.copy)
    assert together.shape == (sum(len(episode) for episode in episodes), 4)
    alone = np.concatenate([sensitivity.predicted_actions(policy, [episode], np.copy) for episode in episodes])
    assert np.allclose(together, alone, atol=1e-5)
    assert np.abs(together - sensitivity.predicted_actions(policy, episodes, sensitivity.shifted_states)).max() > 1e-6


def test_the_action_of_a_chunk_is_that_of_the_newest_frame(episodes, tmp_path):
    policy = without_random_numbers(tmp_path / "run", "copolicy")
    episode = episodes[0]
    actions = sensitivity.predicted_actions(policy, [episode], np.copy)
    rows = slice(10 - policy.n_obs_steps, 10)
    scenario = np.tile(episode.task.scenario_vector(episode.scenario), (policy.n_obs_steps, 1))
    history = {STATE: episode.states[rows], ENVIRONMENT_STATE: scenario, HUMAN_ACTION: episode.past_human_actions[rows]}
    batch = {name: torch.tensor(values[None], dtype=torch.float32) for name, values in history.items()}
    sequence = policy.policy.sample_actions(batch)[0].numpy()
    assert np.allclose(actions[9], sequence[policy.n_obs_steps - 1], atol=1e-5)
    assert not np.allclose(actions[9], sequence[0], atol=1e-3)


def test_a_policy_that_does_not_see_the_velocity_does_not_depend_on_it(episodes, tmp_path):
    masked = {"masked_state": ["vx", "vy", "omega"]}
    for settings, depends in (({}, True), (masked, False)):
        policy = Checkpoint(save_run(tmp_path / f"run{depends}", "bc_lstm_gmm"), settings=settings)
        assert policy.describe().get("masked_state") == settings.get("masked_state")
        changes = [
            sensitivity.predicted_actions(policy, episodes, change) for change in (np.copy, sensitivity.resting_states)
        ]
        assert np.array_equal(*changes) != depends


def test_a_row_for_each_run(sound, sound_recordings, tmp_path, monkeypatch, capsys):
    run = save_run(tmp_path / "bc" / "seed_0", "bc_lstm_gmm", preset="normalized")
    flags = ["--dataset", str(sound_recordings.parent / "set"), "--runs", str(run)]
    monkeypatch.setattr(sys, "argv", ["sensitivity.py", *flags, "--limit", "1"])
    sensitivity.main()
    *_, header, _, row = capsys.readouterr().out.splitlines()
    assert header == "| run | error | velocity 0 | 20 px in y | 30 degrees |"
    name, *numbers = row.strip("| ").split(" | ")
    assert name == "bc/seed_0"
    error, *changes = map(float, numbers)
    assert 0 < error < 2
    assert 0 < max(changes) < 2


@pytest.mark.parametrize(
    ("fps", "limit", "message"), [(30.0, "1", "a policy of 10 Hz"), (10.0, "0", "--limit: expected at least 1")]
)
def test_another_rate_and_no_episode_are_refused(fps, limit, message, sound, sound_recordings, tmp_path, monkeypatch):
    run = save_run(tmp_path / "run", "bc_lstm_gmm", fps=fps)
    flags = ["--dataset", str(sound_recordings.parent / "set"), "--runs", str(run), "--limit", limit]
    monkeypatch.setattr(sys, "argv", ["sensitivity.py", *flags])
    with pytest.raises(SystemExit, match=message):
        sensitivity.main()
