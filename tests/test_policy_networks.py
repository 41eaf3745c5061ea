"""The networks alone: the paper's size, and what an action may depend on."""

import pytest
import torch

from copolicy.tasks.table.spec import SPEC
from lerobot_policy_copolicy.copolicy.denoiser_mlp import MlpDenoiser
from lerobot_policy_copolicy.copolicy.denoiser_transformer import TransformerDenoiser
from lerobot_policy_copolicy.copolicy.denoiser_unet import UnetDenoiser
from lerobot_policy_copolicy.pair_policy.features import AbsoluteFeatures

HORIZON, FRAMES, CONDITION = 12, 3, 20


def transformer(**sizes) -> TransformerDenoiser:
    return TransformerDenoiser(4, CONDITION, HORIZON, FRAMES, **{"n_layers": 2, "width": 32, **sizes}).eval()


def inputs(batch: int = 2) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    actions = torch.randn(batch, HORIZON, 4, generator=generator)
    steps = torch.randint(100, (batch,), generator=generator)
    return actions, steps, torch.randn(batch, FRAMES, CONDITION, generator=generator)


@pytest.mark.parametrize(("past_human_action", "parameters"), [(False, 8_964_868), (True, 8_965_380)])
def test_transformer_has_as_many_parameters_as_the_original(past_human_action, parameters):
    network = TransformerDenoiser(4, AbsoluteFeatures(SPEC, past_human_action).size, HORIZON, FRAMES)
    assert sum(parameter.numel() for parameter in network.parameters()) == parameters


def test_transformer_starts_as_in_the_paper():
    network = transformer(width=256)
    assert network.head.weight.std().item() == pytest.approx(0.02, rel=0.1)
    assert network.action_position.std().item() == pytest.approx(0.02, rel=0.1)
    assert network.layers[0].self_attn.in_proj_weight.std().item() == pytest.approx(0.02, rel=0.1)  # pyright: ignore
    assert torch.equal(network.norm.weight, torch.ones(256))
    assert not network.head.bias.any()


def test_an_action_does_not_see_later_actions():
    network, (actions, steps, condition) = transformer(), inputs()
    before = network(actions, steps, condition)
    actions[:, 5:] += 1
    after = network(actions, steps, condition)
    torch.testing.assert_close(after[:, :5], before[:, :5])
    assert (after[:, 5:] - before[:, 5:]).abs().amin(dim=(0, 2)).min() > 0


@pytest.mark.parametrize("frame", range(FRAMES))
def test_an_action_does_not_see_later_frames(frame):
    network, (actions, steps, condition) = transformer(), inputs()
    before = network(actions, steps, condition)
    condition[:, frame] += 1
    after = network(actions, steps, condition)
    torch.testing.assert_close(after[:, :frame], before[:, :frame])
    assert (after[:, frame:] - before[:, frame:]).abs().amax(dim=(0, 2)).min() > 0


@pytest.mark.parametrize(
    "make",
    [
        transformer,
        lambda: MlpDenoiser(4, CONDITION, HORIZON, FRAMES, 2, 64),
        lambda: UnetDenoiser(4, CONDITION, FRAMES, (16, 32, 32), step_width=16),
    ],
)
def test_every_input_reaches_the_prediction(make):
    torch.manual_seed(0)
    network = make()
    # Both start out nearly or exactly blind (small weights, zero heads); weights of a trained size see everything.
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    actions, steps, condition = inputs()
    before = network(actions, steps, condition)
    assert before.shape == actions.shape
    changes = (actions + torch.randn_like(actions), steps, condition), (actions, steps + 40, condition)
    for changed in (*changes, (actions, steps, condition + torch.randn_like(condition))):
        assert (network(*changed) - before).abs().max() > 1e-2


def test_perceptron_has_the_size_of_the_small_preset():
    network = MlpDenoiser(4, 28, HORIZON, FRAMES, n_layers=3, width=384)
    assert sum(parameter.numel() for parameter in network.parameters()) == 1_132_464


def test_samples_of_a_batch_are_independent():
    network, (actions, steps, condition) = transformer(), inputs(3)
    together = network(actions, steps, condition)
    alone = network(actions[1:2], steps[1:2], condition[1:2])
    torch.testing.assert_close(together[1:2], alone, atol=1e-6, rtol=1e-5)
