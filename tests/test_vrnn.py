"""The VRNN planner as a LeRobot policy: settings, loss, execution, training, studies, either seat."""

import json
from pathlib import Path

import pytest
import torch
from frame_policies import require_acts_at_seat
from lerobot.configs import FeatureType, PolicyFeature

from copolicy.cards.cli import main as cards
from copolicy.collect.agents import load_policy
from copolicy.dataset.exceptions import InvalidValueError, ShapeError, UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.evaluate.cli import main as evaluate
from copolicy.tasks.table.features import FEATURES
from copolicy.train.cli import main as train
from lerobot_policy_copolicy.vrnn.configuration_vrnn import VrnnConfig
from lerobot_policy_copolicy.vrnn.modeling_vrnn import VrnnPolicy

KINDS = {STATE: FeatureType.STATE, ENVIRONMENT_STATE: FeatureType.ENV, HUMAN_ACTION: FeatureType.STATE}


def config(**settings) -> VrnnConfig:
    return VrnnConfig(
        device="cpu",
        input_features={key: PolicyFeature(kind, FEATURES[key]["shape"]) for key, kind in KINDS.items()},
        output_features={ACTION: PolicyFeature(FeatureType.ACTION, FEATURES[ACTION]["shape"])},
        **{"width": 8, "n_samples": 2, **settings},
    )


def batch(policy: VrnnPolicy, size: int = 4) -> dict[str, torch.Tensor]:
    """Windows of tables that move to the right at different speeds, in a map with one obstacle."""
    frames = torch.tensor(policy.config.observation_delta_indices)
    speed = torch.linspace(10, 40, size)[:, None]
    state = torch.zeros(size, len(frames), 7)
    state[..., 0] = 300 + speed * frames / 30
    state[..., 1], state[..., 2], state[..., 4] = 250, -1, speed
    scenario = torch.tensor([240.0, 300, 3.14, 960, 300, 600, 300, 0, 0, 0, 0]).expand(size, len(frames), -1)
    return {STATE: state, ENVIRONMENT_STATE: scenario, ACTION: torch.zeros(size, 1, 4)}


def frame(columns: dict[str, torch.Tensor], index: int = 0) -> dict[str, torch.Tensor]:
    return {key: values[:, index] for key, values in columns.items() if key != ACTION}


def test_the_paper_preset_has_the_published_settings():
    settings = config(preset="paper", width=64).filled
    assert (settings.history_frames, settings.window_frames, settings.encoded_frames) == (30, 120, 30)
    assert (settings.stride, settings.plan_frames + settings.history_frames, settings.lookahead_frames) == (1, 160, 120)
    assert (settings.latent, settings.n_layers, settings.replan_frames, VrnnConfig().n_samples) == (6, 2, 2, 16)
    optimizer = settings.get_optimizer_preset()
    assert (optimizer.lr, optimizer.weight_decay, optimizer.grad_clip_norm) == (8e-4, 0.2, 0.0)
    assert (settings.kl_cycles, settings.kl_ramp, settings.proportional_gain) == (4, 0.5, 0.15)
    assert settings.observation_delta_indices == list(range(-30, 91))
    policy = VrnnPolicy(settings)
    assert sum(weights.numel() for weights in policy.parameters()) == 98_980


@pytest.mark.parametrize(
    ("preset", "features", "symmetries"), [("default", "points", set()), ("scan", "scan", {"mirror"})]
)
def test_a_preset_chooses_the_surroundings(preset, features, symmetries):
    policy = VrnnPolicy(config(preset=preset))
    assert policy.config.observation_features == features
    assert policy.config.used_symmetries >= symmetries
    loss, _ = policy(batch(policy))
    assert torch.isfinite(loss)


@pytest.mark.parametrize(
    ("settings", "error", "text"),
    [
        ({"preset": "small"}, UnknownNameError, "preset"),
        ({"observation_features": "absolute"}, InvalidValueError, "points, relative, scan"),
        ({"history_frames": 31}, InvalidValueError, "history_frames: expected a multiple of stride = 5, found 31"),
        ({"window_frames": 30}, InvalidValueError, "window_frames: expected more than history_frames = 30, found 30"),
        ({"encoded_frames": 200}, InvalidValueError, "encoded_frames: expected at most window_frames"),
        ({"lookahead_frames": 90}, InvalidValueError, "lookahead_frames: expected at most .* = 89, found 90"),
        ({"motion_axes": "left"}, UnknownNameError, "body, scene"),
        ({"motion_deviation": 0.0}, InvalidValueError, "motion_deviation: expected a number above 0, found 0"),
        ({"past_human_action": True}, InvalidValueError, "past_human_action"),
        (
            {"task": "peg"},
            InvalidValueError,
            "task: expected a task with the part `motion`, which vrnn plans, found 'peg'",
        ),
    ],
)
@pytest.mark.usefixtures("peg")
def test_a_wrong_setting_is_one_line(settings, error, text):
    with pytest.raises(error, match=text) as caught:
        config(**settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("encoded", [30, 60])
def test_frames_beyond_the_end_do_not_count(encoded):
    policy = VrnnPolicy(config(encoded_frames=encoded)).eval()
    columns = batch(policy)
    columns[f"{STATE}_is_pad"] = torch.zeros(columns[STATE].shape[:2], dtype=torch.bool)
    columns[f"{STATE}_is_pad"][:, :3] = True  # before the episode: the body at rest, which counts
    losses = []
    for padded in (False, True):
        columns[f"{STATE}_is_pad"][:, -4:] = padded
        for shift in (0.0, 50.0):
            columns[STATE][:, -4:, 1] = 250 + shift
            torch.manual_seed(0)
            losses.append(float(policy(columns)[0].detach()))
    assert losses[0] != pytest.approx(losses[1], rel=1e-3)
    assert losses[2] == pytest.approx(losses[3], rel=1e-6)
    without = {key: values for key, values in columns.items() if not key.endswith("pad")}
    with pytest.raises(ShapeError):
        policy({**without, STATE: columns[STATE][:, 1:]})


def test_the_loss_per_sample_has_the_loss_as_its_mean():
    for preset in ("default", "paper"):
        policy = VrnnPolicy(config(preset=preset)).eval()
        columns = batch(policy)
        torch.manual_seed(0)
        loss, _ = policy(columns)
        torch.manual_seed(0)
        each, _ = policy(columns, reduction="none")
        assert each.shape == (4,)
        torch.testing.assert_close(each.mean(), loss)


def test_it_learns_to_move_on():
    torch.manual_seed(0)
    policy = VrnnPolicy(config(width=16, latent=2, history_frames=20, window_frames=40, encoded_frames=40)).train()
    columns = batch(policy)
    optimizer = torch.optim.Adam(policy.parameters(), 5e-3)
    for _ in range(200):
        loss, _ = policy(columns)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        policy.update()
    assert int(policy.updates) == 200
    policy.eval()
    states = columns[STATE][:, : policy.config.history_frames // 5 + 1]
    path = policy._planner.plan(states, columns[ENVIRONMENT_STATE][:, 0])
    moved = path[:, 5, 0] - states[:, -1, 0]  # px in a second
    torch.testing.assert_close(moved, torch.linspace(10, 40, 4), rtol=0, atol=6)


def test_the_history_before_an_episode_is_rest_or_zeros(monkeypatch):
    seen = {}
    for preset in ("default", "paper"):
        policy = VrnnPolicy(config(preset=preset)).eval()
        plan = policy._planner.plan
        monkeypatch.setattr(
            policy._planner,
            "plan",
            lambda states, scenarios, p=preset, f=plan: seen.setdefault(p, states) is None or f(states, scenarios),
        )
        columns = batch(policy)
        action = policy.select_action(frame(columns))
        assert action.shape == (4, 4)
        assert action.abs().max() <= 1
    assert seen["default"].shape == (4, 7, 7)
    torch.testing.assert_close(seen["default"], seen["default"][:, -1:].expand(-1, 7, -1))
    assert seen["paper"].shape == (4, 31, 7)
    assert (seen["paper"][:, :-1] == 0).all()
    assert (seen["paper"][:, -1, 0] > 100).all()


def test_it_plans_every_other_frame_from_the_last_second(monkeypatch):
    policy = VrnnPolicy(config()).eval()
    columns, seen = batch(policy), []
    plan = policy._planner.plan
    monkeypatch.setattr(policy._planner, "plan", lambda *inputs: seen.append(inputs[0]) or plan(*inputs))
    for step in range(40):
        state = columns[STATE][:, 0].clone()
        state[:, 0] = 300 + step
        policy.select_action({**frame(columns), STATE: state})
    assert len(seen) == 20
    torch.testing.assert_close(seen[-1][0, :, 0], torch.arange(308.0, 339.0, 5))
    policy.reset()
    policy.select_action(frame(columns))
    assert len(seen) == 21


def test_a_temperature_widens_the_sampled_futures():
    torch.manual_seed(0)
    policy = VrnnPolicy(config(n_samples=64)).eval()
    columns = batch(policy, 1)
    states, scenarios = columns[STATE][:, : 30 // policy.config.filled.stride + 1], columns[ENVIRONMENT_STATE][:, 0]
    spreads = []
    for temperature in (0.0, 1.0, 2.0):
        policy.config.temperature = temperature
        torch.manual_seed(1)
        futures = policy._planner.sample(states, scenarios)[0, :, -1, :2]
        spreads.append(futures.std(dim=0).norm().item())
    # The encoder's latent variables of the history vary at any temperature.
    assert 0 < spreads[0] < 0.7 * spreads[1] < 0.5 * spreads[2]


def test_the_defects_of_execution_are_settings():
    paper, default = VrnnPolicy(config(preset="paper")).eval(), VrnnPolicy(config()).eval()
    assert (paper.features.repeat_last, paper.features.velocity_as_goal) == (True, False)
    assert (default.features.repeat_last, default.features.velocity_as_goal) == (False, False)
    assert VrnnPolicy(config(preset="paper", velocity_as_goal=True)).features.velocity_as_goal
    action = paper.select_action(frame(batch(paper)))
    torch.testing.assert_close(action.norm(dim=1), torch.ones(4))


def test_another_rate_scales_the_motion():
    slow, fast = (VrnnPolicy(config(fps=fps, stride=1)) for fps in (10.0, 30.0))
    path = torch.tensor([[[300.0, 300, 1, 0], [305.0, 300, 1, 0]]])
    torch.testing.assert_close(fast._rows.displacements(path)[0, 0, 0], torch.tensor(3.0))
    torch.testing.assert_close(slow._rows.displacements(path)[0, 0, 0], torch.tensor(1.0))


def test_missing_columns_and_chunks_are_one_line():
    policy = VrnnPolicy(config())
    with pytest.raises(InvalidValueError, match=r"the column observation\.state"):
        policy({})
    with pytest.raises(NotImplementedError, match="call select_action"):
        policy.predict_action_chunk(frame(batch(policy)))


@pytest.fixture(scope="module")
def run(sound_recordings, sound, tmp_path_factory) -> Path:
    """A short training run on the data set of six recordings, of 10 Hz."""
    out = tmp_path_factory.mktemp("runs") / "vrnn"
    small = ["width=8", "n_samples=2", "stride=2", "history_frames=4", "window_frames=12", "encoded_frames=4"]
    small += ["plan_frames=10", "lookahead_frames=6"]
    data = [
        f"--dataset.root={sound_recordings.parent / 'set'}",
        f"--output_dir={out}",
        "--batch_size=8",
        "--save_freq=3",
    ]
    assert (
        train(["--policy.type=vrnn", "--policy.device=cpu", *(f"--policy.{s}" for s in small), *data, "--steps=3"]) == 0
    )
    return out


def test_it_is_trained_resumed_and_loaded(run):
    folder = run / "checkpoints" / "last" / "pretrained_model"
    assert json.loads((folder / "config.json").read_text(encoding="utf-8"))["kl_steps"] == 3
    assert train([f"--config_path={folder / 'train_config.json'}", "--resume=true", "--steps=5"]) == 0
    policy = load_policy(run)
    assert policy.name.startswith("policy:vrnn-")
    assert (policy.n_action_steps, policy.fps) == (1, 10)
    assert policy.policy.config.kl_steps == int(policy.policy.updates) == 5


@pytest.mark.parametrize("seat", [0, 1])
def test_it_acts_frame_by_frame_at_either_seat(run, seat):
    require_acts_at_seat(run, seat)


def test_it_is_evaluated_and_described(run, tmp_path):
    out = tmp_path / "eval.json"
    flags = ["--maps", "unseen", "--limit", "2", "--step-limit", "60", "--out", str(out)]
    assert evaluate(["coplan", "--policy", str(run), *flags]) == 0
    result = json.loads(out.read_text(encoding="utf-8"))
    assert result["policy"]["type"] == "vrnn"
    assert result["settings"]["actions_per_plan"] == 1
    again = tmp_path / "again.json"
    assert evaluate(["coplan", "--policy", str(run), *flags[:-1], str(again)]) == 0
    assert json.loads(again.read_text(encoding="utf-8"))["episodes"] == result["episodes"]
    assert train(["export", str(run), "--out", str(tmp_path / "exported"), "--eval", str(out)]) == 0
    assert cards(["model", str(tmp_path / "exported")]) == 0
    card = (tmp_path / "exported" / "README.md").read_text(encoding="utf-8")
    assert "| `type` | vrnn |" in card
    assert "| `controller` | velocity |" in card
    assert "`device`" not in card
    assert load_policy(tmp_path / "exported").weights_sha256 == result["policy"]["weights_sha256"]


def test_adapters_are_refused():
    with pytest.raises(InvalidValueError, match="--peft: expected no adapters: vrnn reads its weights directly"):
        VrnnPolicy(config()).wrap_with_peft(peft_cli_overrides={"method_type": "LORA"})
