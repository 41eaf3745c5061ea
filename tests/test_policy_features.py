"""What the network sees: fixed bounds, table-relative view, padding."""

import math

import numpy as np
import pytest
import torch

from copolicy.dataset.features import (
    BOUNDS,
    ENVIRONMENT_STATE,
    HUMAN_ACTION,
    STATE,
    environment_state,
    state_vector,
)
from copolicy.dataset.task import MapConfig
from lerobot_policy_copolicy.copolicy.features import AbsoluteFeatures, RelativeFeatures


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
    scaled = AbsoluteFeatures(past_human_action=True)(columns)
    torch.testing.assert_close(scaled, torch.full((20,), value), atol=1e-6, rtol=0)


def test_absolute_features_are_the_papers_columns_in_order():
    scaled = AbsoluteFeatures(past_human_action=True)(observation())
    assert scaled[:2].tolist() == pytest.approx([240 / 600 - 1, 120 / 300 - 1])
    assert scaled[2:4].tolist() == pytest.approx([math.cos(3.14), math.sin(3.14)])
    assert scaled[4:7].tolist() == pytest.approx([0.2, -0.4, 0.5 / (math.pi / 2)])
    assert scaled[7:10].tolist() == pytest.approx([240 / 600 - 1, 120 / 300 - 1, 3.14 / math.pi - 1], abs=1e-6)
    assert scaled[14:18].tolist() == [-1.0] * 4  # padding
    assert scaled[18:].tolist() == [0.5, -1.0]
    assert AbsoluteFeatures(past_human_action=False)(observation()).shape == (18,)


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


@pytest.mark.parametrize("features", [AbsoluteFeatures(True), RelativeFeatures(True)])
def test_batches_and_histories_broadcast(features):
    single = observation()
    stacked = {key: values.expand(5, 3, -1) for key, values in single.items()}
    torch.testing.assert_close(features(stacked), features(single).expand(5, 3, -1))
    assert not list(features.state_dict())  # the bounds are the task's, not a checkpoint's
