"""The planner as a process of its own: what it predicts, how it fails, and that the loop goes on meanwhile."""

import os
import time

import numpy as np
import process_policies
import pytest

from copolicy.collect.agents import PolicyAgent, PolicyProcess
from copolicy.collect.rollout import EpisodeStart
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.world import TableWorld

MAP = MAP_SETS["training"][0]
ONE = np.array([0])


@pytest.fixture(scope="module")
def planner():
    process = PolicyProcess(process_policies.load)
    yield process
    process.close()


def test_the_policies_are_those_of_another_process(planner):
    assert planner._call(process_policies.process_id) != os.getpid()
    calm, keeper = planner.policies["calm"], planner.policies["keeper"]
    assert (calm.name, calm.task, calm.n_obs_steps, calm.n_action_steps, calm.fps) == ("calm", "table", 2, 1, 10)
    calm.reset(1)
    assert calm.predict_action_chunk({})[0, 0].tolist() == [1.1, 0, -1.1, 0]
    assert keeper.keeps_history is False
    keeper.predict_action_chunk({})
    assert keeper.keeps_history is True  # known after the first call


def test_the_loop_goes_on_while_the_policy_is_busy_and_takes_its_chunk_up(planner):
    agent = PolicyAgent(planner.policies["busy"], real_time=True)
    world = TableWorld(MAP)
    agent.begin(0, [EpisodeStart(MAP, 0, world.observation)])
    forces, longest = [], 0.0
    end = time.monotonic() + 1.0
    while time.monotonic() < end and not (forces and forces[-1]):
        began = time.monotonic()
        (force,) = agent.act(world.observation[None], ONE)
        action = np.array([*force, 0.0, 0.0])
        world.step(action)
        agent.acted(action[None], ONE)
        forces.append(float(force[0]))
        longest = max(longest, time.monotonic() - began)
        time.sleep(1 / 30)
    agent.close()
    assert forces[0] == 0.0
    assert forces[-1] == pytest.approx(0.3)
    assert longest < 0.2, "the loop waited for the policy's process"
    assert agent.latencies[0] > 0.3


def test_errors_of_loading_are_the_callers():
    with pytest.raises(FileFormatError, match="robot: expected a checkpoint, found none"):
        PolicyProcess(process_policies.load_none)


def test_a_process_that_ends_is_said_in_one_line():
    process = PolicyProcess(process_policies.load)
    with pytest.raises(RunError, match=r"^inference: expected a running process, found that it ended"):
        process.policies["dies"].predict_action_chunk({})
    with pytest.raises(RunError, match=r"^inference: expected a running process"):
        process.policies["calm"].reset(0)
    process.close()
