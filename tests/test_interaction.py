import math

import numpy as np
import pytest

from copolicy.dataset.shared_device import identical_actions
from copolicy.tasks.table.interaction import interaction_force


def test_pulling_apart_is_positive_whatever_the_orientation():
    for theta in np.linspace(0, 2 * math.pi, 9):
        axis = np.array([math.cos(theta), -math.sin(theta)])
        assert interaction_force(theta, np.concatenate((axis, -axis))) == pytest.approx(1.0)
        assert interaction_force(theta, np.concatenate((-axis, axis))) == pytest.approx(-1.0)
        assert interaction_force(theta, np.concatenate((axis, axis))) == pytest.approx(0.0)


def test_it_takes_whole_episodes():
    assert interaction_force(np.zeros(5), np.zeros((5, 4))).shape == (5,)


def test_the_legacy_axis_is_what_the_original_program_stored(upstream):
    trace = np.load(upstream / "interaction.npz")
    actions = np.clip(trace["actions"], -1, 1)
    force = interaction_force(trace["state_after"][:, 2], actions, legacy_axis=True)
    np.testing.assert_allclose(2 * force, trace["inter_f_unit"], atol=1e-9)


def test_actions_of_one_device_are_told_from_those_of_two_people():
    rng = np.random.default_rng(0)
    one = rng.uniform(-1, 1, (300, 2))
    two = np.hstack((one, rng.uniform(-1, 1, (300, 2))))
    both = np.hstack((one, one))
    assert identical_actions(both)
    assert not identical_actions(two)
    # A copy that was read a moment later differs in a frame or two; a player who acted for a tenth of it does not.
    both[7, 2:] = 0.0
    assert identical_actions(both)
    both[100:130, 2:] = 0.0
    assert not identical_actions(both)


def test_nothing_and_rest_are_no_copies():
    assert not identical_actions(np.zeros((0, 4)))
    assert not identical_actions(np.zeros((90, 4)))
    assert not identical_actions(np.full((90, 4), 0.005))
    # They rested, but for one push that was the same.
    rest = np.zeros((90, 4))
    rest[40] = 0.5
    assert identical_actions(rest)
