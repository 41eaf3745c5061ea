"""Co-GAIL as a LeRobot policy: settings, codes in execution, training by its command, studies, either seat."""

import json
from pathlib import Path

import pytest
import torch
from frame_policies import require_acts_at_seat
from lerobot.configs import FeatureType, PolicyFeature
from safetensors.torch import load_file

from copolicy.cards.cli import main as cards
from copolicy.collect.agents import load_policy
from copolicy.dataset.exceptions import InvalidValueError, RunError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main as evaluate
from copolicy.tasks.table.features import FEATURES
from copolicy.train.cli import main as train
from copolicy.train.cogail.log import TrainingLog
from lerobot_policy_copolicy.cogail.codes import GRID, NOISE
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.modeling_cogail import CoGailPolicy
from lerobot_policy_copolicy.cogail.network import Discriminator

KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}


def config(**settings) -> CoGailConfig:
    return CoGailConfig(
        device="cpu",
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        **settings,
    )


def batch(size: int = 5, seed: int = 0) -> dict[str, torch.Tensor]:
    """Random columns of single frames."""
    random = torch.Generator().manual_seed(seed)
    return {key: torch.rand((size, *FEATURES[key]["shape"]), generator=random) for key in KINDS}


def test_it_has_the_published_parameters():
    policy = CoGailPolicy(config())
    assert policy.inputs.size == 116
    assert sum(parameter.numel() for parameter in policy.parameters()) == 31_627
    assert sum(parameter.numel() for parameter in Discriminator(116, 4).parameters()) == 11_969


def test_the_defaults_are_the_published_ones():
    settings = config()
    assert (settings.preset, settings.history, settings.width, settings.code) == ("paper", 15, 64, "drawn")
    assert (settings.input_range, settings.history_start, settings.bounded_actions) == ("unit", "zeros", False)
    assert (settings.reward, settings.after_success, settings.start_frames) == ("logit", "zero", "first")
    assert (settings.gamma, settings.gae_lambda, settings.clip) == (0.99, 0.95, 0.2)
    assert (settings.n_epochs, settings.n_minibatches, settings.frames_per_update) == (10, 32, 6000)
    assert (settings.optimizer_lr, settings.optimizer_grad_clip_norm, settings.discriminator_lr) == (3e-4, 0.5, 1e-3)
    assert (settings.discriminator_passes, settings.first_discriminator_passes) == (5, 50)
    assert (settings.code_weight, settings.inverse_weight, settings.gradient_penalty) == (0.1, 0.1, 10)
    assert config(preset="scan").used_symmetries == {"mirror", "permute_obstacles"}


@pytest.mark.parametrize(
    ("settings", "error", "text"),
    [
        ({"preset": "small"}, UnknownNameError, "corrected, paper, scan"),
        ({"code": "guessed"}, UnknownNameError, "drawn, episode, inferred"),
        ({"history": 0}, InvalidValueError, "history: expected at least 1, found 0"),
        ({"gamma": 1.0}, InvalidValueError, "gamma"),
        ({"n_worlds": 7}, InvalidValueError, r"frames_per_update: expected a multiple of n_worlds \(7\)"),
        ({"past_human_action": True}, InvalidValueError, "past_human_action: expected false"),
    ],
)
def test_a_wrong_setting_is_one_line(settings, error, text):
    with pytest.raises(error, match=text):
        config(**settings)


def test_the_grid_of_codes():
    assert GRID.shape == (25, 2)
    assert torch.allclose(GRID[1], torch.tensor([-0.8, -0.4]))
    assert len(torch.unique(GRID, dim=0)) == 25
    assert GRID.abs().max() + NOISE == pytest.approx(1.0)


def codes_of(policy: CoGailPolicy, frames: int = 4) -> torch.Tensor:
    """Codes `(frames, 5, 2)` of a rollout."""
    codes = []
    for seed in range(frames):
        policy.select_action(batch(seed=seed))
        assert policy._code is not None
        codes.append(policy._code.clone())
    return torch.stack(codes)


def test_a_drawn_code_is_another_one_at_every_frame_around_one_point():
    codes = codes_of(CoGailPolicy(config()))
    assert (codes - torch.tensor([-0.8, -0.4])).abs().max() <= NOISE + 1e-6
    assert len(torch.unique(codes.flatten(0, 1), dim=0)) == 20


def test_a_code_of_an_episode_stays_until_the_reset():
    policy = CoGailPolicy(config(code="episode"))
    codes = codes_of(policy)
    assert (codes == codes[:1]).all()
    policy.reset()
    assert not torch.equal(codes_of(policy)[0], codes[0])


def test_an_inferred_code_is_that_of_the_partners_last_action_in_its_frame():
    policy = CoGailPolicy(config(code="inferred"))
    assert HUMAN_ACTION in policy.config.observation_keys
    codes = codes_of(policy, 3)
    history = torch.stack([batch(seed=seed)[STATE] for seed in range(2)], dim=1)
    padded = torch.cat((torch.zeros(5, 13, 7), history), dim=1)
    inputs = policy.inputs(padded, batch(seed=1)[ENVIRONMENT_STATE])
    expected = policy.network.infer_code(inputs, batch(seed=2)[HUMAN_ACTION])
    torch.testing.assert_close(codes[2], expected)


@pytest.mark.parametrize(("start", "first"), [("zeros", 0.0), ("first", None)])
def test_the_history_before_the_first_frame(start, first):
    policy = CoGailPolicy(config(history_start=start, code="episode"))
    frame = batch()
    policy.select_action(frame)
    history = policy._history
    assert history is not None
    assert history.shape == (5, 15, 7)
    assert torch.equal(history[:, -1], frame[STATE])
    expected = frame[STATE] if first is None else torch.full_like(frame[STATE], first)
    assert torch.equal(history[:, 0], expected)


def test_inputs_are_scaled_by_the_bounds_of_the_task():
    observation = batch()
    observation[STATE] = torch.tensor([1200.0, 0, -1, 1, 50, 0, 0]).repeat(5, 1)
    unit, symmetric = (CoGailPolicy(config(input_range=name, history_start="first")) for name in ("unit", "symmetric"))
    for policy, low, middle in ((unit, 0, 0.5), (symmetric, -1, 0)):
        history = observation[STATE][:, None].repeat(1, 15, 1)
        inputs = policy.inputs(history, observation[ENVIRONMENT_STATE])
        expected = torch.tensor([1, low, low, 1, 1, middle, middle], dtype=torch.float32).repeat(15)
        torch.testing.assert_close(inputs[0, :105], expected)


def test_the_scan_is_that_of_the_current_frame():
    policy = CoGailPolicy(config(preset="scan"))
    assert policy.inputs.size == policy.features.size + 14 * 7
    policy.select_action(batch())


def test_it_does_not_learn_from_batches_and_has_no_chunks(tmp_path, capsys, sound_recordings, sound):
    policy = CoGailPolicy(config())
    with pytest.raises(RunError, match="use copolicy-train cogail"):
        policy(batch())
    with pytest.raises(NotImplementedError, match="call select_action"):
        policy.predict_action_chunk(batch())
    data = f"--dataset.root={sound_recordings.parent / 'set'}"
    flags = [data, f"--output_dir={tmp_path / 'run'}", "--policy.device=cpu"]
    assert train([*flags, "--policy.type=cogail"]) == 2
    assert "the command copolicy-train cogail" in capsys.readouterr().err
    assert train(["cogail", *flags, "--policy.type=bc_lstm_gmm"]) == 2
    assert "--policy.type: expected cogail" in capsys.readouterr().err
    assert train(["cogail", *flags, "--steps=100"]) == 2
    assert "--steps: expected at least 6000, the frames of one update" in capsys.readouterr().err
    assert train(["cogail", *flags, "--batch_size=64"]) == 2
    assert "--batch_size: expected no such flag" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


_SMALL = {"width": 8, "n_worlds": 4, "frames_per_update": 80, "n_minibatches": 4, "n_epochs": 2, "pretrain_epochs": 2}
SMALL = [
    *(f"--policy.{name}={value}" for name, value in _SMALL.items()),
    "--policy.first_discriminator_passes=3",
    "--policy.expert_batch_size=16",
    "--save_freq=160",
    "--seed=3",
]


@pytest.fixture(scope="module")
def run(sound_recordings, sound, tmp_path_factory) -> Path:
    """A short training run on the data set of six recordings."""
    out = tmp_path_factory.mktemp("runs") / "cogail"
    data = f"--dataset.root={sound_recordings.parent / 'set'}"
    assert train(["cogail", data, f"--output_dir={out}", *SMALL, "--steps=400"]) == 0
    return out


def weights(run: Path, step: int) -> dict[str, torch.Tensor]:
    return load_file(run / "checkpoints" / f"{step:06d}" / "pretrained_model" / "model.safetensors")


def test_it_is_trained_in_the_world(run):
    checkpoints = sorted(folder.name for folder in (run / "checkpoints").iterdir())
    assert checkpoints == ["000160", "000320", "000400", "last"]
    rows = [json.loads(line) for line in (run / "training_log.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [row["step"] for row in rows] == [80, 160, 240, 320, 400]
    assert (run / "training_curves.png").is_file()
    changed = weights(run, 160), weights(run, 400)
    assert all(not torch.equal(changed[0][name], changed[1][name]) for name in changed[0])
    policy = load_policy(run)
    assert policy.name.startswith("policy:cogail-")
    assert (policy.n_obs_steps, policy.n_action_steps, policy.chunk_size, policy.fps) == (1, 1, 1, 10)


def test_a_resumed_run_is_the_uninterrupted_one(run, sound_recordings, tmp_path, capsys, monkeypatch):
    out, data = tmp_path / "cogail", f"--dataset.root={sound_recordings.parent / 'set'}"
    with monkeypatch.context() as patch:  # drawing takes most of the time of so short a run
        patch.setattr(TrainingLog, "draw", lambda log, title: None)
        assert train(["cogail", data, f"--output_dir={out}", *SMALL, "--steps=400"]) == 0
    assert not (out / "training_curves.png").exists()
    for step in ("000320", "000400"):
        for file in sorted((out / "checkpoints" / step).rglob("*"), reverse=True):
            file.rmdir() if file.is_dir() else file.unlink()
        (out / "checkpoints" / step).rmdir()
    (out / "checkpoints" / "last").unlink()
    (out / "checkpoints" / "last").symlink_to("000160")
    (out / "checkpoints" / "000320").mkdir()  # a checkpoint that the crash left unfinished
    assert train(["cogail", f"--config_path={out}", "--resume=true"]) == 0
    assert (out / "training_curves.png").is_file()
    expected = weights(run, 400)
    for name, values in weights(out, 400).items():
        assert torch.equal(values, expected[name]), name
    logs = [(folder / "training_log.jsonl").read_text(encoding="utf-8").splitlines() for folder in (run, out)]
    rows = [[{**json.loads(line), "seconds": 0} for line in lines] for lines in logs]
    assert rows[0] == rows[1]
    (out / "checkpoints" / "000400" / "training_state" / "cogail_state.pt").unlink()
    capsys.readouterr()
    assert train(["cogail", f"--config_path={out}", "--resume=true", "--steps=480"]) == 2
    assert "cogail_state.pt: expected the training state of copolicy-train cogail" in capsys.readouterr().err


@pytest.mark.parametrize("seat", [0, 1])
def test_it_acts_frame_by_frame_at_either_seat(run, seat):
    require_acts_at_seat(run, seat)


def test_it_is_evaluated_and_described(run, tmp_path):
    out = tmp_path / "eval.json"
    flags = ["--maps", "training", "--limit", "1", "--step-limit", "60", "--out", str(out)]
    assert evaluate(["coplan", "--policy", str(run), *flags]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert (result["policy"]["type"], result["policy"]["code"]) == ("cogail", "drawn")
    inferred = tmp_path / "inferred.json"
    assert evaluate(["coplan", "--policy", str(run), *flags[:-1], str(inferred), "--code", "inferred"]) == 0
    assert json.loads(inferred.read_text(encoding="utf-8"))["policy"]["code"] == "inferred"
    assert result["settings"]["actions_per_plan"] == 1
    assert train(["export", str(run), "--out", str(tmp_path / "exported"), "--eval", str(out)]) == 0
    recipe = json.loads((tmp_path / "exported" / "recipe.json").read_text(encoding="utf-8"))
    assert (recipe["training"]["steps"], recipe["training"]["samples"]) == (400, 400)
    assert cards(["model", str(tmp_path / "exported")]) == 0
    card = (tmp_path / "exported" / "README.md").read_text(encoding="utf-8")
    assert "| `type` | cogail |" in card
    assert "| `code` | drawn |" in card
    assert "| `reward` | logit |" in card
    assert load_policy(tmp_path / "exported").weights_sha256 == result["policy"]["weights_sha256"]


def test_another_task_trains_without_what_it_lacks(peg, tmp_path):
    from peg_data import convert_pegs, record_pegs

    root = convert_pegs(record_pegs(tmp_path / "recordings"), tmp_path / "pegs")
    flags = [f"--dataset.root={root}", f"--output_dir={tmp_path / 'run'}", "--policy.preset=scan", *SMALL]
    assert train(["cogail", *flags, "--steps=80"]) == 0
    policy = load_policy(tmp_path / "run")
    assert (policy.task, policy.policy.config.observation_features) == ("peg", "absolute")
