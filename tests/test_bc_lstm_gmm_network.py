"""The network of BC-RNN-GMM against robomimic's own (tests/data/robomimic)."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from lerobot_policy_copolicy.bc_lstm_gmm.network import RecurrentMixtureNetwork

REFERENCE = json.loads((Path(__file__).parent / "data/robomimic/bc_rnn_gmm.json").read_text(encoding="utf-8"))
NAMES = {"nets.decoder.nets.scale": "deviation", "nets.decoder.nets.": "", "nets.rnn.nets": "lstm"}


def formula(index, shape):
    """The weights of parameter number `index`, in robomimic's order: any values will do, as long as both have them."""
    i = np.arange(np.prod(shape), dtype=np.float64)
    return torch.from_numpy((0.08 * np.sin(0.731 * i * (1 + 0.01 * index) + index)).reshape(shape).astype(np.float32))


def own_name(name):
    for theirs, ours in NAMES.items():
        name = name.replace(theirs, ours)
    return name


@pytest.fixture(scope="module")
def network():
    network = RecurrentMixtureNetwork(18, 4)
    parameters = dict(network.named_parameters())
    assert sorted(map(own_name, REFERENCE["order"])) == sorted(parameters)
    with torch.no_grad():
        for index, name in enumerate(REFERENCE["order"]):
            parameter = parameters[own_name(name)]
            parameter.copy_(formula(index, tuple(parameter.shape)))
    return network


@pytest.fixture(scope="module")
def windows():
    """Observations `(3, 10, 18)` and actions `(3, 10, 4)`."""
    observations = np.sin(0.37 * np.arange(3 * 10 * 18)).reshape(3, 10, 18)
    actions = np.cos(0.53 * np.arange(3 * 10 * 4)).reshape(3, 10, 4)
    return torch.from_numpy(observations).float(), torch.from_numpy(actions).float()


def test_it_has_as_many_parameters_as_the_papers(network):
    assert sum(parameter.numel() for parameter in network.parameters()) == 1_973_245


def test_its_mixtures_are_robomimics(network, windows):
    mixture, _ = network(windows[0])
    distribution = mixture.distribution()
    normalised = distribution.mixture_distribution.logits[0]
    for name, values in (("logits", normalised), ("means", mixture.means[0]), ("deviations", mixture.deviations[0])):
        torch.testing.assert_close(values, torch.tensor(REFERENCE["train"][name]), rtol=0, atol=1e-5)
    torch.testing.assert_close(
        distribution.log_prob(windows[1]), torch.tensor(REFERENCE["log_prob"]), rtol=1e-5, atol=1e-5
    )
    assert -distribution.log_prob(windows[1]).mean().item() == pytest.approx(REFERENCE["loss"], abs=1e-5)


def test_frame_by_frame_it_says_the_same(network, windows):
    whole, _ = network(windows[0])
    state, means = None, []
    for frame in windows[0].unbind(dim=1):
        mixture, state = network(frame[:, None], state)
        means.append(mixture.means)
    torch.testing.assert_close(torch.cat(means, dim=1), whole.means)


def test_an_action_of_a_frame_is_the_mean_of_a_mode_of_the_windows_mixture():
    network = RecurrentMixtureNetwork(18, 4, width=8)
    inputs = torch.rand(3, 6, 18, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        whole, (hidden, cell) = network(inputs)
        states = None
        for frame in range(6):
            drawn, states = network.sample(inputs[:, frame], states, 0.0, network.layer_weights())
            distances = (whole.means[:, frame] - drawn[:, None]).abs().amax(dim=-1)  # (B, modes)
            assert (distances.amin(dim=1) < 1e-6).all()
    assert states is not None
    for layer, (own_hidden, own_cell) in enumerate(states):
        torch.testing.assert_close(own_hidden, hidden[layer], rtol=1e-5, atol=1e-6)
        torch.testing.assert_close(own_cell, cell[layer], rtol=1e-5, atol=1e-6)


def test_modes_are_drawn_by_their_weights_with_one_deviation_for_all():
    network = RecurrentMixtureNetwork(3, 2, width=8, n_layers=1, n_modes=3)
    with torch.no_grad():
        network.logits.bias.add_(torch.tensor([0.0, 1.0, 2.0]))
        network.mean.weight.zero_()
        network.mean.bias.copy_(torch.tensor([-1.0, -1.0, 0.0, 0.0, 1.0, 1.0]))
        inputs = torch.ones(1, 3)
        mixture, _ = network(inputs[:, None])
        torch.manual_seed(0)
        drawn, _ = network.sample(inputs.expand(20_000, 3), None, 0.05, network.layer_weights())
    mode = (drawn[:, :1] / torch.tanh(torch.tensor(1.0))).round().long()[:, 0] + 1
    shares = torch.bincount(mode, minlength=3) / len(drawn)
    torch.testing.assert_close(shares, torch.softmax(mixture.logits[0, 0], dim=-1), rtol=0, atol=0.015)
    residuals = drawn - mixture.means[0, 0][mode]
    assert residuals.std().item() == pytest.approx(0.05, rel=0.03)
