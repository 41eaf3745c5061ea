"""LeRobot's own policies, trained a few steps on our data, act for both players and at either seat."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from play_session import settings
from straight_carry import record

from copolicy.collect.agents import PolicyAgent, load_policy
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.rollout import Rollout
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main as evaluate
from copolicy.tasks.table.map_config import MapConfig
from copolicy.train.cli import main as train

DIFFUSION = {
    "type": "diffusion", "horizon": 16, "n_obs_steps": 2, "n_action_steps": 8, "down_dims": "[8,16]",
    "diffusion_step_embed_dim": 8, "num_train_timesteps": 4, "n_groups": 4,
}  # fmt: skip
ACT = {
    "type": "act", "chunk_size": 10, "n_action_steps": 8, "dim_model": 16, "n_heads": 2, "dim_feedforward": 16,
    "n_encoder_layers": 1, "n_vae_encoder_layers": 1,
}  # fmt: skip
POLICIES = {"diffusion": DIFFUSION, "act": ACT}


def _trained(root: Path, out: Path, **policy) -> Path:
    flags = [f"--policy.{name}={value}" for name, value in policy.items()]
    data = [f"--dataset.root={root}", f"--output_dir={out}", "--batch_size=8", "--steps=3", "--policy.device=cpu"]
    assert train([*data, *flags]) == 0
    return out


@pytest.fixture(scope="module")
def runs(random_table, tmp_path_factory) -> dict[str, Path]:
    """A run of each."""
    folder = tmp_path_factory.mktemp("runs")
    return {name: _trained(random_table, folder / name, **policy) for name, policy in POLICIES.items()}


def _observations(count: int, frames: int) -> dict[str, np.ndarray]:
    rng, sizes = np.random.default_rng(0), {STATE: 7, ENVIRONMENT_STATE: 11, HUMAN_ACTION: 2}
    return {key: rng.random((count, frames, size)) for key, size in sizes.items()}


@pytest.mark.parametrize(("name", "frames", "longest"), [("diffusion", 2, 15), ("act", 1, 10)])
def test_a_chunk_is_that_of_lerobots_own_batch(runs, name, frames, longest):
    policy = load_policy(runs[name])
    assert (policy.n_obs_steps, policy.n_action_steps, policy.chunk_size) == (frames, 8, longest)
    assert policy.name.startswith(f"policy:{name}-")
    seen = _observations(3, frames)
    policy.reset(5)
    chunk = policy.predict_action_chunk(seen)
    assert chunk.shape == (3, longest, 4)
    batch = {key: torch.tensor(column, dtype=torch.float32) for key, column in seen.items()}
    if name == "act":
        batch = {key: column[:, -1] for key, column in batch.items()}
    torch.manual_seed(5)
    policy.policy.config.n_action_steps = longest
    expected = policy._postprocess(policy.policy.predict_action_chunk(policy._preprocess(batch)))
    np.testing.assert_array_equal(chunk, expected.detach().numpy())
    policy.reset(5)
    policy.n_predicted_actions = 3
    np.testing.assert_array_equal(policy.predict_action_chunk(seen), chunk[:, :3])


@pytest.mark.parametrize("name", POLICIES)
def test_it_is_judged_by_co_planning(runs, name, tmp_path, capsys):
    out = tmp_path / "eval.json"
    flags = ["--maps", "unseen", "--limit", "3", "--step-limit", "60", "--out", str(out)]
    assert evaluate(["coplan", "--policy", str(runs[name]), *flags]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert (result["policy"]["type"], result["policy"]["learned"]["fps"]) == (name, 10)
    assert result["summary"]["planning_ms_per_call"]["n"] == 3  # one call for all three, every 24 steps
    assert {row["plans"] for row in result["episodes"]} == {3}
    assert any(row["interaction_mean"] > 0 for row in result["episodes"])


@pytest.mark.parametrize(("name", "seat"), [("diffusion", 0), ("act", 1)])
def test_it_plays_at_a_seat(runs, name, seat, tmp_path):
    # The other one pulls hard towards a goal nearby: the episode is over in seconds.
    puller = record(tmp_path / "puller.mcap", config=MapConfig((620.0, 300.0, 3.0), (820.0, 300.0)), push=(1, 0, 1, 0))
    players = (PlayerSpec("policy", str(runs[name])), PlayerSpec("replay", str(puller)))
    with prepared(settings(tmp_path, players=players, episodes=1, headless=True, swap_seats=False)) as application:
        if seat:
            application.game.exchange_seats()
        application.run()
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    episode = read_episode(path)
    assert (episode.meta.controller_0, episode.meta.controller_1)[seat].startswith(f"policy:{name}-")
    assert np.abs(episode.actions[:, 2 * seat : 2 * seat + 2]).max() > 0


def test_what_select_action_alone_can_do_is_asked_frame_by_frame(random_table, tmp_path):
    """An ensemble over chunks is LeRobot's example of it."""
    run = _trained(random_table, tmp_path / "run", **{**ACT, "n_action_steps": 1, "temporal_ensemble_coeff": 0.01})
    policy, task = load_policy(run), get_task()
    assert policy.keeps_history
    agent = PolicyAgent(policy, task)
    maps = task.scenario_sets["unseen"][:2]
    rollout = Rollout(task, maps, (agent, agent.human_half()))
    seen = []
    for _ in range(9):
        seen.append([world.observation for world in rollout.worlds])
        rollout.step()
    assert policy.batch_sizes == [2, 2, 2]
    again, expected = load_policy(run).policy, None
    for frame in range(3):
        column = torch.tensor(np.array(seen[3 * frame]), dtype=torch.float32)
        vectors = torch.tensor(np.array([task.scenario_vector(one) for one in maps]), dtype=torch.float32)
        batch = {STATE: column, ENVIRONMENT_STATE: vectors, HUMAN_ACTION: torch.zeros(2, 2)}
        expected = policy._postprocess(again.select_action(policy._preprocess(batch))).detach().numpy()
    np.testing.assert_allclose(rollout.actions, np.clip(np.array(expected), -1, 1), atol=1e-6)


class _Stub:
    """One that predicts no chunks."""

    def __init__(self, config):
        self.config = config

    def reset(self):
        """Nothing to forget."""

    def predict_action_chunk(self, batch):
        raise NotImplementedError("no chunks here")

    def select_action(self, batch):
        return torch.zeros(len(batch[STATE]), 4)


def test_a_policy_without_chunks_is_known_by_its_first_answer(runs):
    policy = load_policy(runs["act"])
    policy.policy = _Stub(policy.policy.config)
    assert policy.predict_action_chunk(_observations(2, 1)).shape == (2, 1, 4)
    assert policy.keeps_history
    policy.policy.select_action = policy.policy.predict_action_chunk
    with pytest.raises(Exception, match="expected actions from predict_action_chunk or select_action, found NotImpl"):
        policy.predict_action_chunk(_observations(2, 1))


def test_one_that_needs_what_the_task_does_not_show_is_refused(runs, tmp_path, capsys):
    config = json.loads((load_policy(runs["act"]).folder / "config.json").read_text(encoding="utf-8"))
    config["input_features"]["observation.images.scene"] = {"type": "VISUAL", "shape": [3, 240, 480]}
    (tmp_path / "config.json").write_text(json.dumps(config), encoding="utf-8")
    (tmp_path / "model.safetensors").write_bytes(b"")
    assert evaluate(["coplan", "--policy", str(tmp_path), "--out", str(tmp_path / "eval.json")]) == 2
    expected = f"a policy that observes {STATE}, {ENVIRONMENT_STATE}, {HUMAN_ACTION} at most"
    found = "one that also needs observation.images.scene"
    assert capsys.readouterr().err.strip().endswith(f"{tmp_path}: expected {expected}, found {found}")
