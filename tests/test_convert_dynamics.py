import math

import numpy as np
import pytest

from copolicy.convert.lerobot.prepare import replay_drift
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.tasks.table.dynamics import integrate, step_angular, step_linear, undo_angular, undo_linear
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

LIMITS = {"states_cap_pi_over_2": math.pi / 2, "states_cap_pi_over_8": math.pi / 8}


@pytest.fixture(params=LIMITS)
def traces(request, upstream):
    """States `(18, 301, 6)`, actions and physics of the original program."""
    with np.load(upstream / "dynamics.npz") as file:
        states, actions = file[request.param], np.clip(file["actions"], -1, 1)
    return states, actions, Physics(angular_acceleration_limit=LIMITS[request.param])


def turn(angle):
    return (angle + math.pi) % (2 * math.pi) - math.pi


def test_steps_are_those_of_the_original(traces):
    states, actions, physics = traces
    states_before, states_after = states[:, :-1], states[:, 1:]
    position, velocity = step_linear(states_before[..., :2], states_before[..., 3:5], actions, physics)
    theta, omega = step_angular(states_before[..., 2], states_before[..., 5], actions, physics)
    assert np.abs(position - states_after[..., :2]).max() < 1e-12
    assert np.abs(velocity - states_after[..., 3:5]).max() < 1e-12
    assert np.abs(turn(theta - states_after[..., 2])).max() < 1e-12
    assert np.abs(omega - states_after[..., 5]).max() < 1e-12


def test_undone_steps_are_those_of_the_original(traces):
    states, actions, physics = traces
    states_before, states_after = states[:, :-1], states[:, 1:]
    position, velocity = undo_linear(states_after[..., :2], states_after[..., 3:5], actions, physics)
    assert np.abs(position - states_before[..., :2]).max() < 1e-11
    assert np.abs(velocity - states_before[..., 3:5]).max() < 1e-12
    theta, omega = undo_angular(states_after[..., 2], states_after[..., 5], actions, physics)
    errors = np.hypot(turn(theta - states_before[..., 2]), omega - states_before[..., 5])
    assert np.nanmin(errors, axis=0).max() < 1e-12
    ambiguous = (~np.isnan(omega)).sum(axis=0) > 1
    assert 0.01 < ambiguous.mean() < 0.5  # the ambiguity is real, and not the rule


def test_integration_is_the_world(traces):
    states, actions, physics = traces
    for path, forces in zip(states, actions, strict=True):
        integrated = integrate(tuple(path[0, :3]), tuple(path[0, 3:]), forces, physics)
        world = TableWorld(MAP_SETS["training"][0], physics)
        world.reset(path[0, :3], path[0, 3:])
        stepped = [(*world.pose, *world.velocity)]
        for force in forces:
            world.step(force)
            stepped.append((*world.pose, *world.velocity))
        difference = integrated - np.array(stepped)
        difference[:, 2] = turn(difference[:, 2])
        assert np.abs(difference).max() < 1e-9


def test_replay_drift_tells_by_how_much_a_path_leaves_its_actions():
    config = MAP_SETS["training"][0]
    world = TableWorld(config)
    actions = np.random.default_rng(1).uniform(-1, 1, (50, 4))
    states = [world.observation]
    for action in actions:
        world.step(action)
        states.append(world.observation)
    states = np.array(states)
    meta = EpisodeMeta("one")
    assert replay_drift(Episode(states[:-1], actions, states[-1], meta, config)) < 1e-9
    moved = states.copy()
    moved[30, 1] += 0.25
    drift = replay_drift(Episode(moved[:-1], actions, moved[-1], meta, config))
    assert drift == pytest.approx(0.25, abs=1e-9)
    at_10_hz = Episode(states[:-1], actions, states[-1], meta, config, fps=10)
    assert math.isnan(replay_drift(at_10_hz))
