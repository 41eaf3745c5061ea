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


def test_frame_by_frame_gives_the_mixtures_of_a_window():
    network = RecurrentMixtureNetwork(18, 4, width=8)
    inputs = torch.rand(3, 6, 18, generator=torch.Generator().manual_seed(0))
    whole, last = network(inputs)
    state, frames = None, []
    with torch.no_grad():
        for frame in range(6):
            mixture, state = network(inputs[:, frame : frame + 1], state)
            frames.append(mixture)
    for name in ("logits", "means", "deviations"):
        values = torch.cat([getattr(mixture, name) for mixture in frames], dim=1)
        torch.testing.assert_close(values, getattr(whole, name).detach(), rtol=1e-5, atol=1e-6)
    assert state is not None
    for one, other in zip(state, last, strict=True):
        torch.testing.assert_close(one, other.detach(), rtol=1e-5, atol=1e-6)
