from itertools import pairwise

import numpy as np
import pytest

from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.routes import route_class, winding


def _path(*points):
    corners = np.array(points, dtype=float)
    return np.vstack([np.linspace(a, b, 50) for a, b in pairwise(corners)])


BELOW = _path((100, 310), (400, 500), (900, 320))
ABOVE = _path((100, 290), (400, 100), (900, 280))


def test_winding_is_half_a_turn_past_an_obstacle_on_the_way():
    # From left of the point to right of it, the angle turns by nearly pi; a circle turns by 2 pi.
    assert -0.5 < winding(BELOW, (400, 300)) < -0.45
    assert winding(ABOVE, (400, 300)) == pytest.approx(-winding(BELOW, (400, 300)))
    angle = np.linspace(0, 2 * np.pi, 100)
    assert winding(np.column_stack((np.cos(angle), np.sin(angle))), (0, 0)) == pytest.approx(1.0)


def test_below_on_screen_is_left_and_above_is_right():
    config = MapConfig((100, 300, 3.14), (900, 300), ((400, 300),))
    assert route_class(BELOW, config) == "L"
    assert route_class(ABOVE, config) == "R"


def test_letters_follow_the_direction_of_the_obstacles_not_their_order():
    config = MapConfig((100, 300, 3.14), (900, 300), ((400, 450), (400, 150)))
    middle = _path((100, 300), (900, 300))
    assert route_class(middle, config) == "LR"
    reverse = MapConfig(config.start, config.goal, config.obstacles[::-1])
    assert route_class(middle, reverse) == "LR"


def test_a_map_without_obstacles_has_an_empty_class():
    assert route_class(BELOW, MapConfig((100, 300, 3.14), (900, 300))) == ""
