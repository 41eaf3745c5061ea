"""The policy on the spec of its task: another task trains without a line of torch, or with features of its own."""

import json
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from small_policies import MLP, TRANSFORMER, columns, lively_policy, policy
from training_table import flags, write_table

from copolicy.collect.agents import PolicyAgent
from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.features import ACTION, HUMAN_ACTION, STATE
from copolicy.dataset.task import PairTask, get_task
from copolicy.train.checkpoint import Checkpoint
from copolicy.train.cli import main
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy
from lerobot_policy_copolicy.pair_policy.features import ActionScale

ROPE = """
from dataclasses import replace

import torch
from lab_peg.task import PegTask

from copolicy.dataset.features import ACTION, HUMAN_ACTION, STATE
from copolicy.dataset.task import PolicyFeatures, Vector


class Distance(torch.nn.Module):
    def __init__(self, past_human_action):
        super().__init__()
        self.size = 1

    def forward(self, observation):
        return observation["observation.environment_state"][..., 1:] - observation[STATE][..., :1]


class RopeTask(PegTask):
    spec = replace(
        PegTask.spec, name="rope", title="", action=Vector(("pull",), ("N",), (0.0,), (8.0,))
    )
    features = PolicyFeatures(
        {"distance": Distance},
        {"mirror": lambda batch: {key: -values for key, values in batch.items()}, "same": lambda batch: batch},
    )
"""


@pytest.fixture
def rope(peg, monkeypatch, tmp_path) -> PairTask:
    """A task with an encoder and symmetries, whose actions are in N."""
    folder = tmp_path / "installed"
    (folder / "lab_rope-1.0.dist-info").mkdir(parents=True)
    (folder / "lab_rope.py").write_text(ROPE, encoding="utf-8")
    about = {
        "METADATA": "Name: lab_rope\nVersion: 1.0\n",
        "entry_points.txt": "[copolicy.tasks]\nrope = lab_rope:RopeTask\n",
    }
    for name, text in about.items():
        (folder / "lab_rope-1.0.dist-info" / name).write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(str(folder))
    return get_task("rope")


@pytest.fixture(autouse=True)
def _logging_as_before():
    """LeRobot replaces the handlers of the root logger."""
    root = logging.getLogger()
    before = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = before


def trained(out: Path) -> Path:
    return out / "checkpoints" / "last" / "pretrained_model"


def test_another_task_trains_on_its_scaled_numbers_alone(peg, tmp_path, capsys):
    data, out = write_table(tmp_path / "data", task="peg"), tmp_path / "out"
    assert main(flags(data, out)) == 0
    left_out = "has no observation_features=scan, mirror=True, permute_obstacles=True (preset 'small')"
    assert f"left out: the task 'peg' {left_out}" in capsys.readouterr().err
    config = json.loads((trained(out) / "config.json").read_text(encoding="utf-8"))
    assert (config["task"], config["observation_features"], config["mirror"]) == ("peg", "absolute", False)
    loaded: Any = CopolicyPolicy.from_pretrained(trained(out), strict=True)
    assert loaded.features.size == 2 + 2 + 1
    chunk = loaded.predict_action_chunk(columns(5, 3, task="peg"))
    assert chunk.shape == (5, 8, 2)
    assert chunk.abs().max() <= 1

    loaded_again = Checkpoint(out)
    assert loaded_again.task == "peg"
    assert loaded_again.conditions.settings == peg.settings_type()
    assert main([f"--policy.path={trained(out)}", *flags(data, tmp_path / "on", steps=1)[:2], "--steps=1"]) == 0
    assert Checkpoint(out).conditions.settings == peg.settings_type()
    assert main(["export", str(out), "--out", str(tmp_path / "model"), "--json"]) == 0
    assert json.loads((tmp_path / "model" / "config.json").read_text(encoding="utf-8"))["task"] == "peg"


def test_what_a_task_lacks_is_refused_where_it_is_asked_for(peg, tmp_path, capsys):
    data = write_table(tmp_path / "data", (14, 5), task="peg")
    for name, value, expected in (
        ("observation_features", "scan", "absolute (the task 'peg' offers no other features)"),
        ("mirror", True, "false (the task 'peg' has no such symmetry)"),
        ("symmetries", ["turn"], "some of none (the task 'peg' has no others)"),
    ):
        settings: dict[str, Any] = {name: value}
        with pytest.raises(InvalidValueError) as caught:
            CopolicyConfig(task="peg", device="cpu", **settings)
        assert str(caught.value) == f"{name}: expected {expected}, found {value!r}"
    out = tmp_path / "out"
    assert main([*flags(data, out), "--policy.observation_features=scan"]) == 2
    line = "observation_features: expected absolute (the task 'peg' offers no other features), found 'scan'"
    assert capsys.readouterr().err.splitlines()[-1].endswith(line)
    assert not out.exists()


def test_the_features_of_the_table_are_named():
    with pytest.raises(InvalidValueError) as caught:
        CopolicyConfig(observation_features="scann", device="cpu")
    expected = "absolute, relative, scan (the task 'table' offers no other features)"
    assert str(caught.value) == f"observation_features: expected {expected}, found 'scann'"


def test_a_policy_of_one_task_refuses_data_of_another(peg, tmp_path, capsys):
    data = write_table(tmp_path / "data", (14, 5), task="peg")
    assert main([*flags(data, tmp_path / "out"), "--policy.task=table"]) == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith("task: expected 'peg', that of the data, found 'table'")


def test_a_task_that_is_not_installed_is_named():
    with pytest.raises(UnknownNameError, match=r"^unknown task 'peg'; available: table$"):
        CopolicyConfig(task="peg", device="cpu")


def test_a_saved_configuration_without_a_task_is_of_the_table(tmp_path):
    policy().save_pretrained(tmp_path)
    path = tmp_path / "config.json"
    config = json.loads(path.read_text(encoding="utf-8"))
    assert config.pop("task") == "table"
    del config["symmetries"]
    path.write_text(json.dumps(config), encoding="utf-8")
    assert CopolicyPolicy.from_pretrained(tmp_path).config == policy().config


@pytest.mark.parametrize("network", [TRANSFORMER, MLP], ids=["transformer", "mlp"])
@pytest.mark.parametrize("backend", ["torch", "onnx", "numba"])
def test_every_backend_plans_for_players_of_one_number_each(peg, backend, network):
    plans = []
    for settings in ({"planner": "plain"}, {"backend": backend}):
        more: dict[str, Any] = {**network, **settings}
        planner = lively_policy(task="peg", **more)
        plans.append(planner.sample_actions(columns(3, 3, task="peg"), torch.Generator().manual_seed(0)))
    assert plans[0].shape == (3, 12, 2)
    torch.testing.assert_close(*plans, atol=1e-5, rtol=1e-5)


def test_features_and_symmetries_of_a_task_are_used(rope):
    learner = policy(task="rope", observation_features="distance", symmetries=["same"], ema=False)
    assert learner.features.size == 1
    assert learner.config.used_symmetries == {"mirror", "same"}
    batch = {**columns(2, 3, task="rope"), ACTION: torch.full((2, 12, 2), 8.0)}
    learner.train()
    seen = []
    learner.diffusion.add_noise = lambda actions: (
        seen.append(actions) or (actions, torch.zeros(2, dtype=torch.long), actions)
    )
    learner(batch)
    torch.testing.assert_close(seen[0], torch.full((2, 12, 2), -3.0))  # -8 N, mirrored, where 0 to 8 N is -1 to 1
    learner.eval()(batch)
    torch.testing.assert_close(seen[1], torch.ones(2, 12, 2))


def test_actions_are_planned_in_the_units_of_the_task(rope):
    planner = lively_policy(task="rope", observation_features="absolute")
    plan = planner.sample_actions(columns(20, 3, task="rope"), torch.Generator().manual_seed(0))
    assert plan.min() >= 0
    assert 4 < plan.max() <= 8
    scale = ActionScale(rope.spec)
    torch.testing.assert_close(scale.scaled(torch.tensor([0.0, 8.0])), torch.tensor([-1.0, 1.0]))
    torch.testing.assert_close(scale.physical(scale.scaled(plan)), plan)
    assert not list(scale.state_dict())
    single = {key: values[:, -1] for key, values in columns(2, 3, task="rope").items()}
    assert single[STATE].shape == (2, 2)
    assert single[HUMAN_ACTION].shape == (2, 1)
    assert planner.select_action(single).shape == (2, 2)


def test_a_policy_sits_down_to_its_own_task_alone(peg):
    learned: Any = SimpleNamespace(name="policy:copolicy-1a2b3c4d", task="peg")
    expected = "policy:copolicy-1a2b3c4d: expected a policy that has learned the task 'table', found 'peg'"
    with pytest.raises(InvalidValueError) as caught:
        PolicyAgent(learned)
    assert str(caught.value) == expected
    assert PolicyAgent(learned, peg).name == learned.name
