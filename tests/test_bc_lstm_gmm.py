"""BC-LSTM-GMM as a LeRobot policy: settings, loss, state in execution, training, studies, either seat."""

import copy
import json
from pathlib import Path

import pytest
import torch
from frame_policies import require_acts_at_seat
from lerobot.configs import FeatureType, PolicyFeature

from copolicy.cards.cli import main as cards
from copolicy.collect.agents import load_policy
from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main as evaluate
from copolicy.tasks.table.features import FEATURES
from copolicy.train.cli import main as train
from lerobot_policy_copolicy.bc_lstm_gmm.configuration_bc_lstm_gmm import BcLstmGmmConfig
from lerobot_policy_copolicy.bc_lstm_gmm.modeling_bc_lstm_gmm import BcLstmGmmPolicy

KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}


def config(**settings) -> BcLstmGmmConfig:
    return BcLstmGmmConfig(
        device="cpu",
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        **{"width": 8, "n_layers": 1, **settings},
    )


def batch(frames: int | None, size: int = 5) -> dict[str, torch.Tensor]:
    """Random columns of windows, or of single frames."""
    random = torch.Generator().manual_seed(0)
    shape = (size,) if frames is None else (size, frames)
    keys = (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)
    return {key: torch.rand((*shape, *FEATURES[key]["shape"]), generator=random) for key in keys}


def test_the_defaults_are_robomimics():
    settings = BcLstmGmmConfig()
    assert (settings.preset, settings.observation_features, settings.past_human_action) == ("paper", "raw", False)
    assert (settings.sequence_length, settings.n_layers, settings.width, settings.n_modes) == (10, 2, 400, 5)
    assert settings.min_deviation == settings.execution_deviation == settings.optimizer_lr == 1e-4
    assert settings.action_delta_indices == settings.observation_delta_indices == list(range(10))
    optimizer = settings.get_optimizer_preset()
    assert (optimizer.lr, optimizer.weight_decay, optimizer.grad_clip_norm) == (1e-4, 0.0, 0.0)
    assert settings.get_scheduler_preset() is None
    decaying = config(scheduler_final_lr_fraction=0.25).get_scheduler_preset()
    assert decaying is not None
    assert (decaying.num_warmup_steps, decaying.final_lr_fraction) == (0, 0.25)


@pytest.mark.parametrize(
    ("preset", "features", "symmetries", "size"),
    [("paper", "raw", set(), 18), ("normalized", "absolute", set(), 18), ("scan", "scan", {"mirror"}, None)],
)
def test_a_preset_chooses_the_inputs(preset, features, symmetries, size):
    policy = BcLstmGmmPolicy(config(preset=preset))
    assert policy.config.observation_features == features
    assert policy.config.used_symmetries >= symmetries
    assert size is None or policy.features.size == size


@pytest.mark.parametrize(
    ("settings", "error", "text"),
    [
        ({"preset": "small"}, UnknownNameError, "preset"),
        ({"observation_features": "pixels"}, InvalidValueError, "absolute, raw, relative, scan"),
        ({"sequence_length": 0}, InvalidValueError, "sequence_length: expected at least 1, found 0"),
        ({"execution_mode": "mean"}, UnknownNameError, "execution_mode.*drawn, likeliest"),
        ({"masked_state": ["theta"]}, UnknownNameError, "masked_state 'theta'.*cos_theta"),
        ({"n_modes": 0}, InvalidValueError, "n_modes: expected at least 1, found 0"),
        ({"min_deviation": 0.0}, InvalidValueError, "min_deviation: expected a number above 0, found 0"),
        ({"optimizer_lr": float("nan")}, InvalidValueError, "optimizer_lr"),
        ({"scheduler_final_lr_fraction": 1.5}, InvalidValueError, "scheduler_final_lr_fraction: expected 0 to 1"),
        ({"mirror": True, "task": "peg"}, InvalidValueError, "mirror"),
    ],
)
@pytest.mark.usefixtures("peg")
def test_a_wrong_setting_is_one_line(settings, error, text):
    with pytest.raises(error, match=text):
        config(**settings)


def test_raw_inputs_are_the_columns_themselves():
    policy = BcLstmGmmPolicy(config())
    columns = batch(10)
    seen = policy.features(columns)
    torch.testing.assert_close(seen, torch.cat((columns[STATE], columns[ENVIRONMENT_STATE]), dim=-1))


@pytest.mark.parametrize("preset", ["paper", "normalized", "scan"])
def test_masked_elements_of_the_state_have_no_effect(preset):
    torch.manual_seed(0)
    shown = BcLstmGmmPolicy(config(preset=preset)).eval()
    masked = BcLstmGmmPolicy(config(preset=preset, masked_state=["vx", "vy", "omega"])).eval()
    masked.load_state_dict(shown.state_dict())
    columns, resting, elsewhere = batch(10), batch(10), batch(10)
    resting[STATE][..., 4:] = 0
    elsewhere[STATE][..., 0] += 1
    loss = masked(columns, reduction="none")[0]
    torch.testing.assert_close(loss, masked(resting, reduction="none")[0], rtol=0, atol=0)
    torch.testing.assert_close(loss, shown(resting, reduction="none")[0], rtol=0, atol=0)
    for changed in (shown(columns, reduction="none")[0], masked(elsewhere, reduction="none")[0]):
        assert (loss - changed).abs().min() > 0
    frame, at_rest = batch(None), batch(None)
    at_rest[STATE][:, 4:] = 0
    acted = []
    for observation in (frame, at_rest):
        torch.manual_seed(0)
        masked.reset()
        acted.append(masked.select_action(observation))
    torch.testing.assert_close(*acted, rtol=0, atol=0)


def test_the_loss_is_the_mean_negative_log_likelihood():
    policy = BcLstmGmmPolicy(config(sequence_length=4)).eval()
    columns = batch(4)
    loss, _ = policy(columns)
    per_sample, _ = policy(columns, reduction="none")
    mixture, _ = policy.network(policy.features(columns))
    likelihood = torch.zeros(5, 4)
    weights = torch.softmax(mixture.logits, dim=-1)
    for mode in range(5):
        z = (columns[ACTION] - mixture.means[:, :, mode]) / mixture.deviations[:, :, mode]
        density = torch.exp(-0.5 * z.square()) / (mixture.deviations[:, :, mode] * (2 * torch.pi) ** 0.5)
        likelihood += weights[:, :, mode] * density.prod(dim=-1)
    torch.testing.assert_close(per_sample, -likelihood.log().mean(dim=1), rtol=1e-4, atol=1e-4)
    torch.testing.assert_close(loss, per_sample.mean())


def test_windows_are_augmented_in_training_alone():
    policy = BcLstmGmmPolicy(config(preset="scan", sequence_length=4)).train()
    columns = batch(4, 200)
    columns[ACTION] = columns[ACTION].abs() + 0.1
    sample = policy._training_sample(columns, 4, 4)
    flipped = sample[ACTION][..., 1] < 0  # a window is mirrored in y as a whole, or not at all
    assert (flipped == flipped[:, :1]).all()
    assert 60 < int(flipped[:, 0].sum()) < 140
    torch.testing.assert_close(sample[ACTION].abs(), columns[ACTION])
    unchanged = policy.eval()._training_sample(columns, 4, 4)
    torch.testing.assert_close(unchanged[ACTION], columns[ACTION], rtol=0, atol=0)


def test_the_state_is_kept_and_reset_every_window():
    policy = BcLstmGmmPolicy(config(sequence_length=3)).eval()
    with torch.no_grad():
        for parameter in policy.network.parameters():
            parameter.normal_(generator=torch.Generator().manual_seed(1))
        policy.network.logits.weight.zero_()
        policy.network.logits.bias.copy_(torch.tensor([30.0, 0, 0, 0, 0]))  # one mode only
    frame = batch(None)
    acted = [policy.select_action(frame) for _ in range(7)]
    # The same frame after a reset gives the same action up to the noise of execution, and another one in between.
    for first, second in ((0, 3), (3, 6), (1, 4), (2, 5)):
        torch.testing.assert_close(acted[first], acted[second], rtol=0, atol=2e-3)
    assert (acted[0] - acted[1]).abs().max() > 0.01
    policy.reset()
    torch.testing.assert_close(policy.select_action(frame), acted[0], rtol=0, atol=2e-3)


def of_the_first_mode(**settings) -> torch.Tensor:
    """Whether each of 400 actions is the mean of the first mode, where two modes are nearly alike in weight."""
    policy = BcLstmGmmPolicy(config(execution_deviation=0.0, **settings)).eval()
    with torch.no_grad():
        policy.network.logits.weight.zero_()
        policy.network.logits.bias.copy_(torch.tensor([0.01, 0.0, -30, -30, -30]))
        policy.network.mean.weight.zero_()
        policy.network.mean.bias.copy_(torch.tensor([1.0] * 4 + [-1.0] * 4 + [0.0] * 12))
    torch.manual_seed(0)
    drawn = torch.stack([policy.select_action(batch(None, 1))[0] for _ in range(400)])
    means = torch.tanh(torch.ones(4))
    is_first = (drawn - means).abs().max(dim=1).values < 1e-5
    assert torch.all(is_first | ((drawn + means).abs().max(dim=1).values < 1e-5))
    return is_first


def test_a_mode_is_drawn_at_each_frame():
    is_first = of_the_first_mode()
    assert 0.4 < is_first.float().mean() < 0.6
    switches = (is_first[1:] != is_first[:-1]).float().mean()
    assert 0.4 < switches < 0.6


def test_the_likeliest_mode_is_taken_at_each_frame():
    assert torch.all(of_the_first_mode(execution_mode="likeliest"))


def by_reset(policy: BcLstmGmmPolicy) -> None:
    with torch.no_grad():
        policy.network.lstm.weight_ih_l0.data.mul_(-2)  # as EMA and fused optimizers: not counted as a change
    policy.reset()


def by_loading(policy: BcLstmGmmPolicy) -> None:
    policy.load_state_dict(BcLstmGmmPolicy(config(n_modes=1)).state_dict())
    policy.reset()


def by_training(policy: BcLstmGmmPolicy) -> None:
    policy.train()
    by_fine_tuning(policy)
    policy.eval()


def by_fine_tuning(policy: BcLstmGmmPolicy) -> None:
    """In the mode of evaluation."""
    optimizer = torch.optim.Adam(policy.get_optim_params(), lr=0.1)
    policy.forward(batch(10))[0].backward()
    optimizer.step()


@pytest.mark.parametrize("change", [by_reset, by_loading, by_training, by_fine_tuning])
def test_actions_are_of_the_weights_as_they_are(change):
    policy = BcLstmGmmPolicy(config(n_modes=1, execution_deviation=0.0)).eval()
    observation = {key: values / 100 for key, values in batch(None).items()}
    with torch.inference_mode():
        policy.select_action(observation)
    change(policy)
    policy._state, policy._frames = None, 0
    with torch.inference_mode():
        acted = policy.select_action(observation)
        mixture, _ = policy.network(policy.features(policy._observation(observation, None))[:, None])
    torch.testing.assert_close(acted, mixture.means[:, 0, 0])


def test_a_policy_that_has_acted_is_copied():
    policy = BcLstmGmmPolicy(config(n_modes=1, execution_deviation=0.0)).eval()
    with torch.inference_mode():
        policy.select_action(batch(None))
    copied = copy.deepcopy(policy)
    torch.testing.assert_close(copied.select_action(batch(None)), policy.select_action(batch(None)))


def test_missing_columns_and_chunks_are_one_line():
    policy = BcLstmGmmPolicy(config())
    with pytest.raises(InvalidValueError, match=r"the column observation\.state"):
        policy({})
    with pytest.raises(NotImplementedError, match="call select_action"):
        policy.predict_action_chunk(batch(None))


@pytest.fixture(scope="module")
def run(sound_recordings, sound, tmp_path_factory) -> Path:
    """A short training run on the data set of six recordings."""
    out = tmp_path_factory.mktemp("runs") / "bc"
    flags = ["--policy.type=bc_lstm_gmm", "--policy.device=cpu", "--policy.width=8", "--policy.n_layers=1"]
    data = [
        f"--dataset.root={sound_recordings.parent / 'set'}",
        f"--output_dir={out}",
        "--batch_size=8",
        "--save_freq=3",
    ]
    assert train([*flags, *data, "--steps=3"]) == 0
    return out


def test_it_is_trained_resumed_and_loaded(run):
    settings = run / "checkpoints" / "last" / "pretrained_model" / "train_config.json"
    assert train([f"--config_path={settings}", "--resume=true", "--steps=5"]) == 0
    policy = load_policy(run)
    assert policy.name.startswith("policy:bc_lstm_gmm-")
    assert (policy.n_obs_steps, policy.n_action_steps, policy.chunk_size, policy.fps) == (1, 1, 1, 10)


@pytest.mark.parametrize("seat", [0, 1])
def test_it_acts_frame_by_frame_at_either_seat(run, seat):
    require_acts_at_seat(run, seat)


def test_it_is_evaluated_and_described(run, tmp_path, capsys):
    out = tmp_path / "eval.json"
    flags = ["--maps", "unseen", "--limit", "2", "--step-limit", "60", "--out", str(out)]
    assert evaluate(["coplan", "--policy", str(run), *flags]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["policy"]["type"] == "bc_lstm_gmm"
    assert result["settings"]["actions_per_plan"] == 1
    again = tmp_path / "again.json"
    assert evaluate(["coplan", "--policy", str(run), *flags[:-1], str(again)]) == 0
    assert json.loads(again.read_text(encoding="utf-8"))["episodes"] == result["episodes"]
    capsys.readouterr()
    assert (
        evaluate(["coplan", "--policy", str(run), *flags[:-1], str(tmp_path / "x.json"), "--n-action-steps", "2"]) == 2
    )
    assert "--n-action-steps: expected 1 to 1, the actions of a chunk, found 2" in capsys.readouterr().err
    assert evaluate(["coplan", "--policy", str(run), *flags[:-1], str(tmp_path / "x.json"), "--sampler", "ddim"]) == 2
    assert "found bc_lstm_gmm without it" in capsys.readouterr().err
    assert train(["export", str(run), "--out", str(tmp_path / "exported"), "--eval", str(out)]) == 0
    assert cards(["model", str(tmp_path / "exported")]) == 0
    card = (tmp_path / "exported" / "README.md").read_text(encoding="utf-8")
    assert "| `type` | bc_lstm_gmm |" in card
    assert "| `min_deviation` | 0.0001 |" in card
    assert "`device`" not in card
    assert load_policy(tmp_path / "exported").weights_sha256 == result["policy"]["weights_sha256"]
