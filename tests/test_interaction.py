import math

import numpy as np
import pytest

from copolicy.dataset.interaction import interaction_force


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
