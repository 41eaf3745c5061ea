"""The policy as LeRobot uses it: training loss, plans, queues, checkpoints."""

from functools import partial
from typing import Any

import pytest
import torch
from lerobot.policies import get_policy_class
from small_policies import MLP, OBSERVATIONS, TRANSFORMER, UNET, columns, policy
from torch._dynamo.utils import counters

from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.features import ACTION, HUMAN_ACTION, STATE
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy


def training_batch(size: int = 8, seed: int = 0) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return {**columns(size, 3, seed=seed), ACTION: torch.rand(size, 12, 4, generator=generator) * 2 - 1}


def test_lerobot_finds_the_policy_by_its_name():
    assert get_policy_class("copolicy") is CopolicyPolicy


@pytest.mark.parametrize(
    "settings", [{"preset": "paper"}, {"preset": "default"}, {"preset": "small", "network": "mlp"}]
)
@pytest.mark.parametrize("past_human_action", [True, False])
def test_learns_a_batch_by_heart(settings, past_human_action):
    learner = policy(**settings, past_human_action=past_human_action, mirror=False, width=64, attention_dropout=0.0)
    before = learner.ema.model.head.weight.clone()
    optimizer = torch.optim.AdamW(learner.get_optim_params(), lr=3e-3)
    batch = training_batch(4)
    learner.train()
    losses = []
    for _ in range(150):
        loss, _ = learner(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        learner.update()
        losses.append(loss.item())
    assert sum(losses[-20:]) / 20 < 0.6 * sum(losses[:5]) / 5
    assert not torch.equal(learner.ema.model.head.weight, before)


def test_human_action_is_seen_only_with_the_switch():
    changed = columns(2, 3)
    changed[HUMAN_ACTION] = -changed[HUMAN_ACTION]
    for past_human_action in (True, False):
        planner = policy(past_human_action=past_human_action, initial_noise_scale=0.0).eval()
        assert (
            torch.equal(planner.sample_actions(columns(2, 3)), planner.sample_actions(changed)) is not past_human_action
        )


def test_plan_is_repeatable_and_in_range():
    planner = policy().eval()
    plans = [planner.sample_actions(columns(3, 3), torch.Generator().manual_seed(5)) for _ in range(2)]
    assert torch.equal(*plans)
    assert plans[0].shape == (3, 12, 4)
    assert plans[0].abs().max() <= 1
    assert not torch.equal(plans[0], planner.sample_actions(columns(3, 3), torch.Generator().manual_seed(6)))
    noise = torch.randn((3, 12, 4), generator=torch.Generator().manual_seed(5))
    assert torch.equal(plans[0], planner.sample_actions(columns(3, 3), noise=noise))
    with pytest.raises(ShapeError, match=r"^noise: expected shape \(3, 12, 4\), got \(3, 11, 4\)$"):
        planner.sample_actions(columns(3, 3), noise=noise[:, :11])


def test_plan_uses_the_moving_average_where_there_is_one():
    averaged, raw = (policy(ema=ema, initial_noise_scale=0.0).eval() for ema in (True, False))
    assert torch.equal(averaged.sample_actions(columns(1, 3)), raw.sample_actions(columns(1, 3)))
    for planner in (averaged, raw):
        torch.nn.init.constant_(planner.denoiser.head.bias, 0.5)
    assert not torch.equal(averaged.sample_actions(columns(1, 3)), raw.sample_actions(columns(1, 3)))
    assert raw.ema is None
    assert not any(key.startswith("ema.") for key in raw.state_dict())


def test_selected_actions_are_the_plans_tokens_from_the_current_frame_on():
    planner = policy(initial_noise_scale=0.0).eval()
    frames = [columns(2, seed=seed) for seed in range(10)]
    actions = [planner.select_action(frame) for frame in frames]

    def plan(*indices: int) -> torch.Tensor:
        return planner.sample_actions(
            {key: torch.stack([frames[i][key] for i in indices], dim=1) for key in OBSERVATIONS}
        )

    first, second = plan(0, 0, 0), plan(6, 7, 8)  # at the start the history is copies of the first frame
    for index, action in enumerate(actions):
        expected = first[:, 2 + index] if index < 8 else second[:, 2 + index - 8]
        torch.testing.assert_close(action, expected)
    planner.reset()
    torch.testing.assert_close(planner.select_action(frames[4]), plan(4, 4, 4)[:, 2])


def test_chunk_takes_whole_histories_or_single_frames():
    planner = policy(initial_noise_scale=0.0, n_action_steps=10).eval()
    history = columns(2, 3)
    chunk = planner.predict_action_chunk(history)
    torch.testing.assert_close(chunk, planner.sample_actions(history)[:, 2:])
    chunks = [planner.predict_action_chunk({key: history[key][:, frame] for key in history}) for frame in range(3)]
    torch.testing.assert_close(chunks[-1], chunk)


def test_padded_actions_can_be_left_out_of_the_loss():
    learner = policy(do_mask_loss_for_padding=True).eval()
    batch = training_batch(4)
    batch[f"{ACTION}_is_pad"] = torch.zeros(4, 12, dtype=torch.bool)

    def loss(reduction: str = "mean") -> torch.Tensor:
        torch.manual_seed(1)
        return learner(batch, reduction)[0]

    whole, each = loss(), loss("none")
    assert each.shape == (4,)
    torch.testing.assert_close(each.mean(), whole)
    batch[f"{ACTION}_is_pad"][0] = True
    torch.testing.assert_close(loss(), each[1:].mean())
    assert loss("none")[0] == 0
    del batch[f"{ACTION}_is_pad"]
    with pytest.raises(InvalidValueError, match=r"^batch, for do_mask_loss_for_padding: expected action_is_pad"):
        loss()


def test_weight_decay_spares_biases_norms_and_positions():
    learner = policy()
    decayed, plain = learner.get_optim_params()
    names = {id(parameter): name for name, parameter in learner.denoiser.named_parameters()}
    assert {id(p) for group in (decayed, plain) for p in group["params"]} == set(names)  # the average is in neither
    spared = {names[id(parameter)] for parameter in plain["params"]}
    assert plain["weight_decay"] == 0.0
    assert "weight_decay" not in decayed  # the optimizer's
    assert {"action_position", "condition_position", "head.bias", "norm.weight"} <= spared
    assert not spared & {"head.weight", "layers.0.self_attn.in_proj_weight", "condition_encoder.0.weight"}


@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor that is not a leaf")  # torch's own, while tracing
@pytest.mark.parametrize("network", [TRANSFORMER, MLP, UNET])
def test_one_compiled_layer_serves_all_and_learns_the_same(monkeypatch, network):
    # The "eager" backend traces and guards as the usual one does, and needs no compiler.
    monkeypatch.setattr(torch, "compile", partial(torch.compile, backend="eager"))
    torch.compiler.reset()
    counters.clear()
    settings = {**network, "n_layers": 3, "attention_dropout": 0.0} if network is TRANSFORMER else network
    plain, compiled = (policy(**settings, compile_model=on).train() for on in (False, True))
    assert compiled.state_dict().keys() == plain.state_dict().keys()
    losses = []
    for learner in (plain, compiled):
        torch.manual_seed(0)
        loss, _ = learner(training_batch())
        loss.backward()
        losses.append(loss.item())
    assert counters["stats"]["unique_graphs"] == 1
    assert losses[1] == pytest.approx(losses[0], rel=1e-5)
    for one, other in zip(plain.denoiser.parameters(), compiled.denoiser.parameters(), strict=True):
        torch.testing.assert_close(one.grad, other.grad)


def test_augmentation_is_for_training_only():
    learner = policy(mirror=True, prediction_type="sample", attention_dropout=0.0)
    # A network that says 0.5 whatever it is given: its loss tells whether the actions were mirrored.
    for parameter in learner.denoiser.parameters():
        torch.nn.init.zeros_(parameter)
    torch.nn.init.constant_(learner.denoiser.head.bias, 0.5)
    batch = training_batch(64)
    actions = batch[ACTION]
    plain = (actions - 0.5).square().mean(dim=(1, 2))
    mirrored = (actions * torch.tensor([1.0, -1.0, 1.0, -1.0]) - 0.5).square().mean(dim=(1, 2))

    torch.testing.assert_close(learner.eval()(batch, "none")[0], plain)
    losses = learner.train()(batch, "none")[0]
    was_mirrored = torch.isclose(losses, mirrored)
    assert torch.equal(~was_mirrored, torch.isclose(losses, plain))
    assert 16 < was_mirrored.sum() < 48


@pytest.mark.parametrize("network", [TRANSFORMER, MLP])
def test_checkpoint_brings_back_the_same_plans(tmp_path, network):
    saved = policy(**network, initial_noise_scale=0.3)
    for parameter in saved.parameters():
        torch.nn.init.normal_(parameter, std=0.1)
    for _ in range(3):
        saved.update()
    saved.save_pretrained(tmp_path)
    loaded: Any = CopolicyPolicy.from_pretrained(tmp_path, strict=True)
    generator = [torch.Generator().manual_seed(0) for _ in range(2)]
    assert torch.equal(
        saved.eval().sample_actions(columns(2, 3), generator[0]), loaded.sample_actions(columns(2, 3), generator[1])
    )
    assert loaded.config == saved.config
    assert loaded.ema.decay == saved.ema.decay


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda b: b.pop(STATE), InvalidValueError, "batch: expected the column observation.state, found"),
        (
            lambda b: b.update({STATE: b[STATE][:, :2]}),
            ShapeError,
            r"observation.state: expected shape \(B, 3, 7\), got \(8, 2, 7\)",
        ),
        (
            lambda b: b.update({ACTION: b[ACTION][..., :2]}),
            ShapeError,
            r"action: expected shape \(B, 12, 4\), got \(8, 12, 2\)",
        ),
    ],
)
def test_wrong_batches_are_named(change, error, message):
    batch = training_batch()
    change(batch)
    with pytest.raises(error, match=message):
        policy()(batch)


def test_wrong_frame_is_named():
    frame = columns(2)
    frame[HUMAN_ACTION] = frame[HUMAN_ACTION][:, :1]
    with pytest.raises(ShapeError, match=r"^observation.human_action: expected shape \(B, 2\), got \(2, 1\)$"):
        policy().select_action(frame)
