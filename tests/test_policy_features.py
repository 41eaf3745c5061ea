"""What the network sees: fixed bounds, table-relative view, padding."""

import math

import numpy as np
import pytest
import torch

from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import BOUNDS, environment_state, state_vector
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.policy.encoders import RelativeFeatures, ScanFeatures
from copolicy.tasks.table.policy.range_scan import RANGE, RAYS, RangeScan
from copolicy.tasks.table.spec import SPEC
from lerobot_policy_copolicy.pair_policy.features import AbsoluteFeatures


def observation(pose=(240.0, 120.0, 3.14), obstacles=((480.0, 300.0),), human=(0.5, -1.0)) -> dict[str, torch.Tensor]:
    config = MapConfig((240.0, 120.0, 3.14), (960.0, 180.0), obstacles)
    columns = {
        STATE: state_vector(pose, (10.0, -20.0, 0.5)),
        ENVIRONMENT_STATE: environment_state(config),
        HUMAN_ACTION: np.array(human),
    }
    return {key: torch.tensor(values, dtype=torch.float32) for key, values in columns.items()}


@pytest.mark.parametrize(("end", "value"), [(0, -1.0), (1, 1.0)])
def test_absolute_features_map_the_bounds_to_one(end, value):
    columns = {key: torch.tensor(BOUNDS[key][end], dtype=torch.float32) for key in BOUNDS}
    scaled = AbsoluteFeatures(SPEC, past_human_action=True)(columns)
    torch.testing.assert_close(scaled, torch.full((20,), value), atol=1e-6, rtol=0)


def test_absolute_features_are_the_papers_columns_in_order():
    scaled = AbsoluteFeatures(SPEC, past_human_action=True)(observation())
    assert scaled[:2].tolist() == pytest.approx([240 / 600 - 1, 120 / 300 - 1])
    assert scaled[2:4].tolist() == pytest.approx([math.cos(3.14), math.sin(3.14)])
    assert scaled[4:7].tolist() == pytest.approx([0.2, -0.4, 0.5 / (math.pi / 2)])
    assert scaled[7:10].tolist() == pytest.approx([240 / 600 - 1, 120 / 300 - 1, 3.14 / math.pi - 1], abs=1e-6)
    assert scaled[14:18].tolist() == [-1.0] * 4  # padding
    assert scaled[18:].tolist() == [0.5, -1.0]
    assert AbsoluteFeatures(SPEC, past_human_action=False)(observation()).shape == (18,)


def test_relative_features_move_with_the_table():
    features = RelativeFeatures(past_human_action=True)
    there = features(observation())
    here = features(observation(pose=(900.0, 200.0, 3.14), obstacles=((1140.0, 380.0),)))
    # Same offset from table to obstacle: same view of it, another of the goal.
    assert there.shape == (features.size,) == (28,)
    torch.testing.assert_close(there[11:16], here[11:16])
    assert there[11:16].tolist() == pytest.approx([240 / 300, 180 / 300, 1.5, 1.5, 1.0])
    assert here[7:11].tolist() == pytest.approx([60 / 300, -20 / 300, 60 / 120, -20 / 120])
    assert there[7:11].tolist() == pytest.approx([720 / 300, 60 / 300, 1.5, 60 / 120])


def test_an_empty_slot_is_all_zeros_and_an_obstacle_is_marked():
    seen = RelativeFeatures(past_human_action=False)(observation(obstacles=((480.0, 300.0), (720.0, 180.0))))
    slots = seen[11:].reshape(3, 5)
    assert slots[:, 4].tolist() == [1.0, 1.0, 0.0]
    assert not slots[2].any()
    assert seen.shape == (26,)


def test_far_things_are_clipped():
    seen = RelativeFeatures(past_human_action=False)(observation(pose=(1190.0, 590.0, 0.0), obstacles=((1.0, 1.0),)))
    assert seen[11:15].tolist() == pytest.approx([-3.0, -589 / 300, -1.5, -1.5])


@pytest.mark.parametrize("features", [AbsoluteFeatures(SPEC, True), RelativeFeatures(True), ScanFeatures(True)])
def test_batches_and_histories_broadcast(features):
    single = observation()
    stacked = {key: values.expand(5, 3, -1) for key, values in single.items()}
    torch.testing.assert_close(features(stacked), features(single).expand(5, 3, -1))
    assert not list(features.state_dict())  # the bounds are the task's, not a checkpoint's


def scan(x: float, y: float, *obstacles: tuple[float, float]) -> list[float]:
    """Distances that a scan sees from (x, y), px."""
    centres = torch.zeros(3, 2)
    for slot, centre in enumerate(obstacles):
        centres[slot] = torch.tensor(centre)
    return ((1 - RangeScan()(torch.tensor([x, y]), centres)) / 2 * RANGE).tolist()


def test_a_scan_sees_the_near_side_of_an_obstacle():
    ahead, down, back, up = scan(600.0, 300.0, (750.0, 300.0))[:: RAYS // 4]
    assert ahead == pytest.approx(125.0, abs=0.1)  # 150 px to the centre, 25 px nearer to its side
    assert (down, back, up) == pytest.approx((300.0, RANGE, 300.0), abs=0.1)


def test_a_scan_sees_the_nearest_of_all_whatever_their_order():
    near, far = (700.0, 310.0), (850.0, 290.0)
    assert scan(600.0, 300.0, far, near) == pytest.approx(scan(600.0, 300.0, near, far))
    assert scan(600.0, 300.0, far, near)[0] == pytest.approx(75.0, abs=0.1)


def test_a_slanted_ray_ends_where_it_enters_the_square():
    # 30 degrees: the square about (600 + 173.2, 300 + 100) is entered by its left side.
    ray = scan(600.0, 300.0, (773.2, 400.0))[3]
    assert ray == pytest.approx((173.2 - 25) / math.cos(math.pi / 6), abs=0.1)


def test_a_scan_from_inside_an_obstacle_is_contact():
    assert scan(600.0, 300.0, (610.0, 310.0)) == pytest.approx([0.0] * RAYS, abs=1e-3)


def test_scan_features_are_the_relative_ones_and_the_scan():
    features = ScanFeatures(past_human_action=True)
    seen = features(observation())
    assert seen.shape == (features.size,) == (28 + RAYS,)
    torch.testing.assert_close(seen[:28], RelativeFeatures(past_human_action=True)(observation()))
    assert seen[28].item() == -1.0  # nothing ahead within reach
    assert seen[28 + RAYS * 3 // 4].item() == pytest.approx(1 - 2 * 120 / RANGE)  # the upper wall
