import math

import numpy as np
import pytest

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import ENVIRONMENT_STATE
from copolicy.tasks.table import features
from copolicy.tasks.table.maps import MAP_SETS


def test_every_column_has_names_and_bounds_of_its_size():
    for key, bounds in features.BOUNDS.items():
        (size,) = features.FEATURES[key]["shape"]
        assert bounds.shape == (2, size)
        assert len(features.FEATURES[key]["names"]) == size
        assert (bounds[0] < bounds[1]).all()


@pytest.mark.parametrize("name", MAP_SETS)
def test_maps_lie_inside_the_bounds_and_come_back_from_their_vector(name):
    low, high = features.BOUNDS[ENVIRONMENT_STATE]
    for config in MAP_SETS[name]:
        vector = features.environment_state(config)
        assert ((low <= vector) & (vector <= high)).all()
        assert features.map_from_vector(vector, config.obstacle_size) == config


def test_an_obstacle_behind_an_empty_slot_is_refused():
    vector = features.environment_state(MAP_SETS["training"][0])
    vector[9:11] = 5.0
    vector[5:7] = 0.0
    with pytest.raises(InvalidValueError, match="obstacles before the zero padding"):
        features.map_from_vector(vector, 50)


def test_state_vector_holds_the_orientation():
    for theta in (0.0, 1.0, 3.14, 6.0):
        state = features.state_vector((1.0, 2.0, theta), (3.0, 4.0, 5.0))
        assert state.shape == (7,)
        assert features.theta_of(state) == pytest.approx(theta, abs=1e-12)
    np.testing.assert_array_equal(state[4:], (3, 4, 5))
    assert features.theta_of(np.array([0, 0, 1, -1e-3, 0, 0, 0])) > math.pi
