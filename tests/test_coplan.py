"""Co-planning: the harness against recorded demonstrations, and the command against a checkpoint."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from untrained_policy import save_untrained_policy

from copolicy.dataset import clock
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main
from copolicy.evaluate.coplan.rollouts import coplan
from copolicy.evaluate.summary import success_rate
from copolicy.tasks.table.agents import simulated_pair
from copolicy.tasks.table.features import environment_state
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld
from copolicy.train.checkpoint import Checkpoint


def _demonstration(config, seed):
    """The 10 Hz actions of one simulated episode, and the path it took."""
    world, pilots = TableWorld(config), simulated_pair(config, "S01", seed)
    actions, path = [], [world.pose[:2]]
    while True:
        action = np.concatenate([pilot.act(world.observation) for pilot in pilots])
        outcome = world.step(action)
        actions.append(action)
        path.append(world.pose[:2])
        if outcome.done:
            assert outcome.success
            return clock.frame_actions(np.array(actions), 10), np.array(path)


class ReplayPolicy:
    """Predicts what was demonstrated on each map, and remembers what it was shown."""

    name, task, n_obs_steps, n_action_steps, fps, keeps_history = "replay", "table", 3, 8, 10, False

    def __init__(self, demonstrations, maps):
        self.demonstrations = {tuple(environment_state(m)): d for m, d in zip(maps, demonstrations, strict=True)}
        self.calls = []

    def reset(self, seed):
        """A replay has no noise."""

    def predict_action_chunk(self, history):
        first = len(self.calls) * self.n_action_steps
        self.calls.append(history)
        plans = []
        for vector in history[ENVIRONMENT_STATE][:, -1]:
            rest = self.demonstrations[tuple(vector)][first : first + 10]
            plans.append(np.vstack((rest, np.zeros((10 - len(rest), 4)))))
        return np.array(plans)


def test_a_replayed_demonstration_reaches_its_goal_on_its_path():
    maps = MAP_SETS["training"][:7:3]
    recorded = [_demonstration(config, seed) for seed, config in enumerate(maps)]
    policy = ReplayPolicy([actions for actions, _ in recorded], maps)
    outcomes = coplan(policy, maps, Physics())
    for outcome, (actions, path) in zip(outcomes, recorded, strict=True):
        assert outcome.success
        assert outcome.reason == "goal"
        assert outcome.path is not None
        assert outcome.interaction is not None
        steps = min(len(path), len(outcome.path))
        assert np.abs(outcome.path[:steps] - path[:steps]).max() < 2.0
        assert outcome.chunks == -(-outcome.steps // 24)
        assert len(outcome.interaction) == outcome.steps == len(outcome.path) - 1
        assert abs(outcome.steps - 3 * len(actions)) <= 6


def test_the_history_is_on_the_grid_of_frames_and_never_stale():
    (config,) = maps = MAP_SETS["training"][:1]
    actions, _ = _demonstration(config, 0)
    policy = ReplayPolicy([actions], maps)
    coplan(policy, maps, Physics())
    first, second = policy.calls[:2]
    # At the start the first observation is repeated and nothing was done before.
    assert (first[STATE] == first[STATE][:, :1]).all()
    assert not first[HUMAN_ACTION].any()
    # At the second plan, 24 steps on, the newest frame is now and its past human action is the eighth executed one.
    np.testing.assert_allclose(second[HUMAN_ACTION][0], actions[5:8, 2:])
    world = TableWorld(config)
    expected = [world.observation]
    for action in clock.zero_order_hold(actions[:8], 10):
        world.step(action)
        expected.append(world.observation)
    np.testing.assert_array_equal(second[STATE][0], [expected[18], expected[21], expected[24]])


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy as a checkpoint folder."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint"))


def _command(checkpoint, out, *flags):
    limits = ("--limit", "3", "--step-limit", "60")
    return main(["coplan", "--policy", str(checkpoint), "--maps", "unseen", "--out", str(out), *limits, *flags])


def test_the_command_writes_a_result_and_a_picture(checkpoint, tmp_path, capsys):
    out = tmp_path / "results" / "eval.json"
    assert _command(checkpoint, out) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["study"] == "coplan"
    assert "no person took part" in result["label"]
    assert result["settings"]["complete_set"] is False
    assert result["summary"]["success"]["episodes"] == 3 == len(result["episodes"])
    assert [row["map_id"] for row in result["episodes"]] == ["unseen-00", "unseen-01", "unseen-02"]
    # An untrained network plans nothing useful: the table stays where it is until the limit.
    assert result["summary"]["ended_by"] == {"timeout": 3}
    assert {row["steps"] for row in result["episodes"]} == {60}
    assert result["summary"]["time_to_completion_s"]["mean"] is None
    assert result["summary"]["planning_ms_per_call"]["n"] == 3
    assert len(result["policy"]["weights_sha256"]) == 64
    assert out.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in out.parent.iterdir()) == ["eval.json", "eval.png"]
    assert "success" in capsys.readouterr().out


def test_the_same_seed_gives_the_same_plans(checkpoint):
    policy = Checkpoint(checkpoint)
    # The untrained head is zero and would plan rest from any noise.
    torch.manual_seed(0)
    for parameter in policy.policy.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    paths = []
    for seed in (0, 0, 1):
        outcomes = coplan(policy, MAP_SETS["unseen"][:2], Physics(step_limit=90), seed=seed)
        paths.append(np.array([outcome.path for outcome in outcomes]))
    np.testing.assert_array_equal(paths[0], paths[1])
    assert np.abs(paths[0] - paths[2]).max() > 0.1


def test_an_existing_result_is_not_replaced(checkpoint, tmp_path, capsys):
    out = tmp_path / "eval.json"
    out.write_text("{}", encoding="utf-8")
    assert _command(checkpoint, out) == 2
    assert (
        capsys.readouterr()
        .err.strip()
        .endswith("eval.json: expected a path that does not exist yet, found one; nothing was overwritten")
    )
    assert out.read_text(encoding="utf-8") == "{}"
    assert _command(checkpoint, out, "--overwrite") == 0
    assert json.loads(out.read_text(encoding="utf-8"))["study"] == "coplan"


def test_a_folder_without_a_checkpoint_is_named(tmp_path, capsys):
    assert _command(tmp_path, tmp_path / "eval.json") == 2
    assert capsys.readouterr().err == (
        f"copolicy-eval: {tmp_path}: expected a checkpoint folder with config.json and model.safetensors, "
        "found an empty folder\n"
    )


def test_more_actions_than_a_plan_holds_are_refused(checkpoint, tmp_path, capsys):
    assert _command(checkpoint, tmp_path / "eval.json", "--n-action-steps", "11") == 2
    assert "--n-action-steps: expected 1 to 10, the actions of a chunk, found 11" in capsys.readouterr().err


def test_a_setting_that_the_policy_lacks_is_refused(checkpoint):
    with pytest.raises(FileFormatError, match="expected a policy with the setting 'temperature'"):
        Checkpoint(checkpoint, settings={"temperature": 2.0})


def test_success_rate_states_its_uncertainty():
    rate = success_rate([True] * 63 + [False] * 21)
    assert rate["mean"] == 0.75
    assert rate["standard_error"] == pytest.approx((0.75 * 0.25 / 84) ** 0.5)
    assert rate["wilson_95"] == pytest.approx([0.6479, 0.8299], abs=5e-4)
    assert success_rate([True] * 10)["wilson_95"] == pytest.approx([0.7225, 1.0], abs=5e-4)


@pytest.mark.parametrize("name", ["eval.png", "eval"])
def test_a_result_whose_figure_might_have_its_name_is_refused(checkpoint, tmp_path, capsys, name):
    assert _command(checkpoint, tmp_path / name) == 2
    assert capsys.readouterr().err == (
        f"copolicy-eval: --out: expected a name that ends with .json, found '{tmp_path / name}'\n"
    )
    assert not list(tmp_path.iterdir())
