"""The symmetries of the table: mirrored samples obey the mirrored world."""

import math

import numpy as np
import torch

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.features import environment_state, map_from_vector
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.policy.symmetries import mirror, permute_obstacles
from copolicy.tasks.table.world import TableWorld

ALL = torch.tensor([True])


def rollout(config: MapConfig, actions: np.ndarray) -> dict[str, torch.Tensor]:
    """A sample of one episode: `(1, T, n)` columns."""
    world = TableWorld(config)
    states = []
    for action in actions:
        states.append(world.observation)
        world.step(action)
    columns = {
        STATE: np.array(states),
        ENVIRONMENT_STATE: np.tile(environment_state(config), (len(actions), 1)),
        HUMAN_ACTION: actions[:, 2:],
        ACTION: actions,
        "next.reward": np.arange(len(actions), dtype=float)[:, None],
    }
    return {key: torch.tensor(values)[None] for key, values in columns.items()}


def test_mirrored_sample_is_what_the_mirrored_world_does():
    actions = np.random.default_rng(0).uniform(-1, 1, (60, 4))
    config = MapConfig((400.0, 200.0, 2.0), (960.0, 180.0), ((720.0, 420.0), (480.0, 300.0)))
    mirrored = mirror(rollout(config, actions), ALL)
    map_config = map_from_vector(mirrored[ENVIRONMENT_STATE][0, 0].numpy(), 50)
    assert map_config.goal == (960.0, 420.0)
    assert map_config.obstacles == ((720.0, 180.0), (480.0, 300.0))
    repeated = rollout(map_config, mirrored[ACTION][0].numpy())
    for key, values in repeated.items():
        torch.testing.assert_close(mirrored[key], values, atol=1e-9, rtol=0)


def test_mirroring_twice_changes_nothing_and_the_unchosen_stay():
    sample = rollout(MAP_SETS["training"][-1], np.random.default_rng(1).uniform(-1, 1, (5, 4)))
    twice = mirror(mirror(sample, ALL), ALL)
    unchosen = mirror(sample, ~ALL)
    for key, values in sample.items():
        torch.testing.assert_close(twice[key], values, atol=1e-9, rtol=0)
        assert torch.equal(unchosen[key], values)


def test_mirrored_start_angle_stays_in_one_turn():
    for theta in (0.0, 3.14, 3 * math.pi / 2):
        sample = rollout(MapConfig((400.0, 200.0, theta), (960.0, 180.0)), np.zeros((1, 4)))
        angle = mirror(sample, ALL)[ENVIRONMENT_STATE][0, 0, 2].item()
        assert 0 <= angle < 2 * math.pi
        assert math.isclose(math.sin(angle), -math.sin(theta), abs_tol=1e-12)


def test_obstacles_are_shuffled_among_themselves():
    torch.manual_seed(0)
    centres = {(480.0, 300.0), (720.0, 180.0)}
    config = MapConfig((240.0, 120.0, 3.14), (960.0, 180.0), tuple(sorted(centres)))
    sample = {key: values.expand(200, -1, -1) for key, values in rollout(config, np.zeros((3, 4))).items()}
    shuffled = permute_obstacles(sample)[ENVIRONMENT_STATE]
    orders = set()
    for row in shuffled:
        assert torch.equal(row, row[:1].expand_as(row))  # one order for all frames of a sample
        permuted = map_from_vector(row[0].numpy(), 50)  # raises if padding comes before an obstacle
        assert set(permuted.obstacles) == centres
        assert (permuted.start, permuted.goal) == (config.start, config.goal)
        orders.add(permuted.obstacles)
    assert len(orders) == 2


def test_every_order_of_three_is_equally_likely():
    torch.manual_seed(0)
    config = MapConfig((240.0, 120.0, 3.14), (960.0, 180.0), ((480.0, 300.0), (720.0, 180.0), (720.0, 420.0)))
    sample = {key: values.expand(6000, -1, -1) for key, values in rollout(config, np.zeros((1, 4))).items()}
    shuffled = permute_obstacles(sample)[ENVIRONMENT_STATE][:, 0, 5:]
    _, counts = shuffled.unique(dim=0, return_counts=True)
    assert len(counts) == 6
    assert counts.min() > 850
