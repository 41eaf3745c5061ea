"""A checkpoint knows the rate and the physics that it learned at, and every evaluation takes both from there."""

import json
import math
import shutil
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from lerobot.datasets import LeRobotDatasetMetadata
from training_table import flags, write_table
from untrained_policy import save_untrained_policy

from copolicy.collect.agents import PolicyAgent
from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.collect.play.command import _angular_limit
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.rollout import EpisodeStart
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.evaluate.cli import main as evaluate
from copolicy.evaluate.human_study.plan import StudyPlan
from copolicy.evaluate.study_flags import study_protocol
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld
from copolicy.train.cli import main as train
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy
from lerobot_policy_copolicy.env import TableCarryingEnvConfig
from lerobot_policy_copolicy.pair_policy.training_data import record_conditions
from lerobot_policy_copolicy.vrnn.configuration_vrnn import VrnnConfig

SLOW = Physics(angular_acceleration_limit=math.pi / 8)


def _physics_json(physics: Physics) -> str:
    return json.dumps(asdict(physics), sort_keys=True)


def _set_physics(root: Path, texts: list[str | None]) -> None:
    for path in (root / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        pq.write_table(table.append_column("physics", pa.array(texts, pa.string())), path)


def _set_rate(root: Path, fps: int) -> None:
    info = root / "meta" / "info.json"
    content = {**json.loads(info.read_text(encoding="utf-8")), "fps": fps}
    info.write_text(json.dumps(content), encoding="utf-8")
    (path,) = (root / "data").glob("*/*.parquet")
    table = pq.read_table(path)
    times = np.asarray(table.column("frame_index"), np.float32) / fps
    pq.write_table(table.set_column(table.schema.get_field_index("timestamp"), "timestamp", pa.array(times)), path)


def _checkpoint(folder: Path, **settings) -> Path:
    """An untrained policy whose configuration says what it learned at."""
    save_untrained_policy(folder)
    config = folder / "config.json"
    config.write_text(json.dumps({**json.loads(config.read_text(encoding="utf-8")), **settings}), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def fast(tmp_path_factory) -> Path:
    dynamics = {name: value for name, value in asdict(SLOW).items() if name != "step_limit"}
    return _checkpoint(tmp_path_factory.mktemp("fast") / "policy", fps=30, physics=dynamics)


@pytest.fixture(scope="module")
def old(tmp_path_factory) -> Path:
    folder = _checkpoint(tmp_path_factory.mktemp("old") / "policy")
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    for name in ("fps", "physics", "physics_mixture"):
        del config[name]
    (folder / "config.json").write_text(json.dumps(config), encoding="utf-8")
    return folder


def test_training_records_rate_and_physics_of_its_episodes_and_export_keeps_them(tmp_path):
    root = write_table(tmp_path / "table", (14, 9, 12))
    _set_rate(root, 30)
    _set_physics(root, [_physics_json(SLOW), _physics_json(Physics(step_limit=7)), _physics_json(SLOW)])
    run = tmp_path / "run"
    assert train([*flags(root, run, steps=1), "--dataset.episodes=[0,2]"]) == 0
    config = json.loads((run / "checkpoints" / "last" / "pretrained_model" / "config.json").read_text(encoding="utf-8"))
    assert config["fps"] == 30
    assert config["physics"]["angular_acceleration_limit"] == math.pi / 8
    assert config["physics_mixture"] == {}
    assert train(["export", str(run), "--out", str(tmp_path / "exported")]) == 0
    shutil.rmtree(root)
    assert training_conditions(tmp_path / "exported") == TrainingConditions(30, SLOW)
    recipe = json.loads((tmp_path / "exported" / "recipe.json").read_text(encoding="utf-8"))
    assert recipe["dataset"]["fps"] == 30


def test_a_mixture_is_recorded_with_its_counts_and_is_no_physics(copied_table, caplog):
    slow, usual = _physics_json(SLOW), _physics_json(Physics())
    _set_physics(copied_table, [slow, usual, usual, "", None, _physics_json(Physics(step_limit=50))])
    meta = LeRobotDatasetMetadata("local/table", copied_table)
    config = CopolicyConfig(device="cpu")
    record_conditions(config, meta, None)
    assert config.fps == 10
    assert config.physics is None
    assert sorted(config.physics_mixture.values()) == [1, 2, 3]
    assert config.physics_mixture[""] == 2
    assert "recorded under different physics" in caplog.text
    record_conditions(config, meta, [1, 2, 3])
    assert config.physics is not None
    assert config.physics["angular_acceleration_limit"] == math.pi / 2
    assert config.physics_mixture[""] == 1


@pytest.mark.parametrize(
    ("kind", "setting", "frames"), [(VrnnConfig, "history_frames", 30), (CoGailConfig, "history", 15)]
)
def test_settings_in_frames_of_another_rate_are_named(copied_table, caplog, kind, setting, frames):
    record_conditions(kind(device="cpu"), LeRobotDatasetMetadata("local/table", copied_table), None)
    assert f"{setting} = {frames} is for data of 30 frames a second, and local/table has 10; convert" in caplog.text
    caplog.clear()
    divided = kind(device="cpu", **{setting: frames // 3})
    record_conditions(divided, LeRobotDatasetMetadata("local/table", copied_table), None)
    _set_rate(copied_table, 30)
    record_conditions(kind(device="cpu"), LeRobotDatasetMetadata("local/table", copied_table), None)
    assert "all settings in frames" not in caplog.text


def test_what_a_checkpoint_does_not_say_is_assumed_and_said(old, tmp_path):
    conditions = training_conditions(old)
    assert (conditions.fps, conditions.settings) == (10, Physics())
    assert conditions.notes == (
        "the checkpoint does not say its rate; 10 frames a second are assumed",
        "the checkpoint does not say its physics; angular acceleration up to pi/2 rad/s^2 is assumed",
    )
    # A recipe beside it may say it.
    copy = Path(shutil.copytree(old, tmp_path / "copy"))
    (copy / "recipe.json").write_text('{"dataset": {"fps": 15}}', encoding="utf-8")
    assert training_conditions(copy).fps == 15
    # So may the data set that it was trained on, where that is still there.
    (copy / "recipe.json").unlink()
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text('{"fps": 30}', encoding="utf-8")
    settings = {"dataset": {"root": str(tmp_path)}}
    (copy / "train_config.json").write_text(json.dumps(settings), encoding="utf-8")
    assert training_conditions(copy).fps == 30


@pytest.mark.parametrize("broken", [{"fps": "ten"}, {"fps": -1}, {"physics": {"mass": "heavy"}}, {"physics": {"a": 1}}])
def test_conditions_that_cannot_be_are_one_line(tmp_path, broken):
    (tmp_path / "config.json").write_text(json.dumps({"type": "copolicy", **broken}), encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"config.json: expected"):
        training_conditions(tmp_path)


def test_coplan_runs_at_the_rate_and_under_the_physics_of_the_checkpoint(fast, old, tmp_path, caplog):
    def settings(policy: Path, *more: str) -> tuple[dict, str]:
        out = tmp_path / "eval.json"
        call = ["coplan", "--policy", str(policy), "--limit", "1", "--step-limit", "30", "--out", str(out)]
        assert evaluate([*call, "--overwrite", *more]) == 0
        return json.loads(out.read_text(encoding="utf-8")), caplog.text

    result, said = settings(fast)
    told = result["settings"]
    assert (told["fps"], told["hold"], told["angular_acceleration_limit"]) == (30, 1, math.pi / 8)
    assert "told_otherwise" not in told
    assert result["policy"]["learned"]["fps"] == 30
    assert "warning" not in said
    result, said = settings(old)
    assert (result["settings"]["fps"], result["settings"]["hold"]) == (10, 3)
    assert len(result["policy"]["learned"]["notes"]) == 2
    result, said = settings(fast, "--fps", "10", "--angular-limit", "pi/2")
    told = result["settings"]
    assert (told["fps"], told["angular_acceleration_limit"]) == (10, math.pi / 2)
    assert len(told["told_otherwise"]) == 2
    assert "learned from 30 frames a second" in told["told_otherwise"][1]
    assert all(line in said for line in told["told_otherwise"])


def _arguments(**values) -> Namespace:
    return Namespace(**{"fps": None, "angular_limit": None, "step_limit": 2000, **values})


def test_policies_that_learned_under_different_physics_need_a_decision():
    usual, slow = TrainingConditions(10, Physics()), TrainingConditions(30, SLOW)
    with pytest.raises(InvalidValueError, match=r"^--angular-limit: expected a choice"):
        study_protocol(_arguments(), [("one", usual), ("other", slow)])
    protocol = study_protocol(_arguments(angular_limit="pi/8"), [("one", usual), ("other", slow)])
    assert protocol.settings == Physics(math.pi / 8, 2000)
    assert protocol.fps == 10
    assert protocol.contradictions == ("--angular-limit pi/8: one learned with 1.571 rad/s^2",)
    with pytest.raises(InvalidValueError, match=r"^fps: expected a divisor of 30"):
        study_protocol(_arguments(), [("one", TrainingConditions(25, Physics()))])


def test_partner_and_human_plan_take_them_from_the_checkpoint(fast, tmp_path):
    out = tmp_path / "partner.json"
    call = ["partner", str(fast), "--baseline", "passive", "--configurations", "4", "--partners", "slow"]
    assert evaluate([*call, "--step-limit", "30", "--out", str(out)]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert (result["settings"]["fps"], result["settings"]["angular_acceleration_limit"]) == (30, math.pi / 8)
    assert result["episodes"][0]["plans"] == result["episodes"][0]["steps"]  # a plan at every step of 1/30 s
    plan = tmp_path / "plan.json"
    robots = [f"A={fast}", f"B={fast}"]
    assert evaluate(["human", "plan", *robots, "--participants", "1", "--out", str(plan)]) == 0
    assert StudyPlan.read(plan).world_settings.angular_acceleration_limit == math.pi / 8


class _Fast:
    name, task, n_obs_steps, fps, n_action_steps, keeps_history = "policy:fast", "table", 2, 30, 3, False

    def reset(self, seed):
        """No noise."""

    def predict_action_chunk(self, observations):
        return np.array([[[0.1 * k, 0.0, 0.0, 0.0] for k in range(6)]])


def test_a_policy_of_30_hz_at_a_seat_acts_anew_at_every_step():
    agent, worlds = PolicyAgent(_Fast(), real_time=True), np.array([0])
    world = TableWorld(MAP_SETS["training"][0])
    agent.begin(0, [EpisodeStart(world.map_config, 0, world.observation)])
    forces = []
    for _ in range(3):
        agent.wait(10)
        forces.append(agent.act(world.observation[None], worlds)[0, 0])
        action = np.array([forces[-1], 0.0, 0.0, 0.0])
        world.step(action)
        agent.acted(action[None], worlds)
    agent.close()
    assert forces == pytest.approx([0.0, 0.1, 0.2])


def test_play_takes_the_limit_of_the_policy_at_the_table(fast, old, caplog):
    robot, person = PlayerSpec("policy", str(fast)), PlayerSpec("keyboard")
    assert _angular_limit((robot, person), None) == math.pi / 8
    assert _angular_limit((person, person), None) == math.pi / 2
    assert not [record for record in caplog.records if record.levelname == "WARNING"]
    assert _angular_limit((robot, person), "pi/2") == math.pi / 2
    assert "trained with 0.3927 rad/s^2" in caplog.text
    with pytest.raises(InvalidValueError, match=r"^--angular-limit: expected one value"):
        _angular_limit((robot, PlayerSpec("policy", str(old))), None)


def test_an_environment_of_another_rate_is_refused(fast, caplog):
    def loaded(environment: TableCarryingEnvConfig) -> CopolicyPolicy:
        return CopolicyPolicy.from_pretrained(fast)

    with pytest.raises(InvalidValueError, match=r"^--env.fps: expected 30, the frames a second"):
        loaded(TableCarryingEnvConfig())
    loaded(TableCarryingEnvConfig(fps=30))
    words = ("angular acceleration up to pi/8 rad/s^2", "angular acceleration up to pi/2 rad/s^2")
    assert "The policy learned under {}; the environment has {}".format(*words) in caplog.text
