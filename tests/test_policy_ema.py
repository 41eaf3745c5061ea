"""The moving average: its schedule, what it is part of, and that it survives a checkpoint."""

import pytest
import torch
from torch import nn

from lerobot_policy_copolicy.copolicy.ema import ExponentialMovingAverage


def network(value: float = 0.0) -> nn.Module:
    layers = nn.Sequential(nn.Linear(2, 3), nn.Dropout(0.5))
    with torch.no_grad():
        for parameter in layers.parameters():
            parameter.fill_(value)
    return layers


def average(model: nn.Module, **settings) -> ExponentialMovingAverage:
    return ExponentialMovingAverage(model, **{"power": 0.75, "inv_gamma": 1.0, "max_decay": 0.9999, **settings})


def test_decay_follows_the_schedule():
    ema = average(network())
    decays = []
    for _ in range(5):
        decays.append(ema.decay)
        ema.update(network())
    assert decays == pytest.approx([0.0, 0.0, 1 - 2**-0.75, 1 - 3**-0.75, 1 - 4**-0.75])


def test_decay_is_bounded():
    ema = average(network(), max_decay=0.5)
    for _ in range(10):
        ema.update(network())
    assert ema.decay == 0.5


def test_update_moves_towards_the_weights():
    ema = average(network(0.0))
    ema.update(network(1.0))
    ema.update(network(1.0))
    assert all((parameter == 1).all() for parameter in ema.model.parameters())
    ema.update(network(2.0))
    expected = 1 + 2**-0.75
    assert next(ema.model.parameters()).flatten()[0].item() == pytest.approx(expected)


def test_copy_is_not_trained():
    model = network()
    ema = average(model)
    ema.train()
    assert not any(module.training for module in ema.modules())
    assert not any(parameter.requires_grad for parameter in ema.parameters())
    assert {id(p) for p in ema.parameters()}.isdisjoint(id(p) for p in model.parameters())


def test_count_survives_a_checkpoint():
    ema, resumed = average(network()), average(network())
    for value in range(7):
        ema.update(network(float(value)))
    resumed.load_state_dict(ema.state_dict())
    assert resumed.decay == ema.decay
    ema.update(network(9.0))
    resumed.update(network(9.0))
    assert int(resumed.updates) == int(ema.updates) == 8
    for a, b in zip(ema.parameters(), resumed.parameters(), strict=True):
        assert torch.equal(a, b)
