"""The task contract, and the table as the first task that keeps it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import get_task, installed_tasks
from copolicy.dataset.task_spec import Vector
from copolicy.tasks.table.features import ACTION_NAMES, BOUNDS, ENVIRONMENT_NAMES, STATE_NAMES, state_vector


def test_the_table_is_installed_as_any_task_is():
    assert "table" in installed_tasks()
    task = get_task("table")
    assert task is get_task("table") is get_task() is get_task(name="table")
    assert task.spec.name == "table"


def test_a_task_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(UnknownNameError, match=r"unknown task 'peg'; available: .*table"):
        get_task("peg")


def test_the_spec_of_the_table_is_that_of_its_data_sets():
    spec = get_task("table").spec
    assert spec.state.names == STATE_NAMES
    assert spec.scenario.names == ENVIRONMENT_NAMES
    assert spec.joint_action.names == ACTION_NAMES
    assert np.array_equal(spec.state.bounds, BOUNDS[STATE])
    assert np.array_equal(spec.scenario.bounds, BOUNDS[ENVIRONMENT_STATE])


def test_recorded_states_become_those_that_the_world_shows_to_the_last_bit():
    task = get_task("table")
    world = task.make_world(task.scenario_sets["unseen"][9])
    recorded, seen = [], []
    for step in range(40):
        world.step(np.array([math.sin(step), 0.3, -0.2, math.cos(2 * step)]))
        recorded.append(world.recorded)
        seen.append(world.observation)
    assert np.array_equal(task.states_of(np.array(recorded)), np.array(seen))
    x, y, theta, *velocity = recorded[-1]
    assert np.array_equal(seen[-1], state_vector((x, y, theta), tuple(velocity)))


def test_a_restored_world_goes_on_bit_for_bit():
    task = get_task("table")
    scenario = task.scenario_sets["training"][3]
    first, second = task.make_world(scenario), task.make_world(scenario)
    action = np.array([0.9, 0.2, 0.4, -0.7])
    for _ in range(10):
        first.step(action)
    second.restore(first.recorded)
    for _ in range(10):
        first.step(action)
        second.step(action)
    assert first.recorded == second.recorded


def test_a_scenario_comes_back_from_its_text_and_from_its_vector():
    task = get_task("table")
    scenario = task.scenario_sets["holdout"][1]
    assert task.scenario_of_json(scenario.to_json()) == scenario
    columns = {"obstacle_size": scenario.obstacle_size}
    assert task.scenario_of_vector(task.scenario_vector(scenario), columns) == scenario
    assert task.identify(scenario) == ("holdout-01", "holdout")


def test_a_vector_without_sense_is_refused():
    with pytest.raises(InvalidValueError, match="as many units"):
        Vector(("x", "y"), ("px",), (0.0, 0.0), (1.0, 1.0))
    with pytest.raises(InvalidValueError, match="low values below"):
        Vector(("x",), ("px",), (1.0,), (1.0,))


def test_full_forces_are_the_farthest_bounds_of_a_number():
    action = Vector(("grip", "push"), ("N", "N"), (-10.0, 0.0), (5.0, 4.0))
    forces = replace(get_task("table").spec, action=action).full_forces(np.array([[5.0, 2.0, -10.0, 4.0]], np.float32))
    assert (forces.dtype, forces.tolist()) == (np.float32, [[0.5, 0.5, -1.0, 1.0]])
