"""The rollout: worlds side by side, the arguments of agents, observers, and the exchange of seats."""

import math

import numpy as np
import pytest

from copolicy.collect.agents import ConstantAgent, RecordedAgent, ScriptedAgent
from copolicy.collect.rollout import Agent, Rollout, Trace
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.task import get_task
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.task import TableTask

TASK = get_task()
MAPS = TASK.scenario_sets["training"][:3]


class Listener(Agent):
    """Pushes right, each world for itself, and stores its arguments."""

    name = "listener"

    def __init__(self):
        self.starts, self.states, self.acted_in = [], [], []

    def begin(self, seat, starts):
        self.seat, self.starts = seat, list(starts)

    def act(self, states, worlds):
        self.states.append(states)
        return np.stack((2.0 + worlds, 0.1 * worlds), axis=1)  # beyond what is allowed

    def acted(self, actions, worlds):
        self.acted_in.append((actions, worlds.tolist()))


def pairs(seed=0, maps=MAPS, **settings):
    agents = (ScriptedAgent.from_pair("S01"), ScriptedAgent.from_pair("S01"))
    return Rollout(TASK, maps, agents, seeds=[seed + k for k in range(len(maps))], **settings)


def test_agents_get_start_states_and_joint_actions():
    robot, human = Listener(), Listener()
    rollout = Rollout(TASK, MAPS, (robot, human), seeds=[4, 5, 6], settings=Physics(step_limit=2))
    assert (robot.seat, human.seat) == (0, 1)
    assert [(start.scenario, start.seed) for start in robot.starts] == list(zip(MAPS, (4, 5, 6), strict=True))
    rest = np.array([world.observation for world in rollout.worlds])
    np.testing.assert_array_equal([start.state for start in human.starts], rest)
    rollout.run()
    np.testing.assert_array_equal(robot.states[0], rest)
    actions, worlds = robot.acted_in[1]
    np.testing.assert_allclose(actions, [[1.0, 0.1 * k, 1.0, 0.1 * k] for k in range(3)])
    assert worlds == [0, 1, 2]
    assert [outcome.reason for outcome in rollout.outcomes] == ["timeout"] * 3
    assert (rollout.ends, len(rollout.running)) == ([2, 2, 2], 0)


def test_parallel_worlds_behave_like_single_ones():
    together = pairs()
    trace = Trace(together)
    together.run()
    for index, config in enumerate(MAPS):
        alone = pairs(index, [config])
        alone_trace = Trace(alone)
        alone.run()
        np.testing.assert_array_equal(trace.states(index), alone_trace.states(0))
        np.testing.assert_array_equal(trace.actions(index), alone_trace.actions(0))
        assert together.outcomes[index] == alone.outcomes[0]
        assert together.ends[index] == len(alone_trace.actions(0))


def test_steps_can_be_bounded_and_can_go_beyond_the_end():
    agents = (ConstantAgent(np.array([-1.0, 0.0])), ConstantAgent(np.array([-1.0, 0.0])))
    short = Rollout(TASK, MAPS[:1], agents)
    short.run(5)
    assert short.worlds[0].step_count == 5
    beyond = Rollout(TASK, MAPS[:1], agents, settings=Physics(step_limit=3), beyond_end=True)
    beyond.run(8)
    assert (beyond.outcomes[0].reason, beyond.ends, beyond.worlds[0].step_count) == ("timeout", [3], 8)


def test_recorded_actions_end_with_zeros():
    actions = np.arange(8.0).reshape(2, 4) / 10
    agents = (RecordedAgent([actions]), RecordedAgent([actions]))
    rollout = Rollout(TASK, MAPS[:1], agents)
    trace = Trace(rollout)
    rollout.run(3)
    np.testing.assert_array_equal(trace.actions(0), [*actions, np.zeros(4)])


def test_a_task_without_simulated_players_says_so(monkeypatch):
    monkeypatch.setattr(TableTask, "agents", None)
    with pytest.raises(CopolicyError, match=r"^left out: the task 'table' has no agents$"):
        ScriptedAgent.from_pair("S01")


def test_a_table_with_exchanged_seats_moves_in_the_same_way():
    exchange = TASK.exchange
    assert exchange is not None
    rng = np.random.default_rng(0)
    for config in (*MAPS, *TASK.scenario_sets["varied"][:3]):
        plain, exchanged = TASK.make_world(config), TASK.make_world(exchange.scenario(config))
        for action in rng.uniform(-1, 1, (200, 4)):
            np.testing.assert_allclose(exchange.states(plain.observation), exchanged.observation, atol=1e-9)
            plain.step(action)
            exchanged.step(exchange.actions(action))


def test_an_exchange_undoes_itself():
    exchange, config = TASK.exchange, MAPS[0]
    assert exchange is not None
    twice = exchange.scenario(exchange.scenario(config))
    assert twice.start == pytest.approx(config.start)
    assert (twice.goal, twice.obstacles) == (config.goal, config.obstacles)
    assert exchange.scenario(config).start[2] == pytest.approx((config.start[2] + math.pi) % (2 * math.pi))
    numbers = np.arange(28.0).reshape(4, 7)
    np.testing.assert_array_equal(exchange.states(exchange.states(numbers)), numbers)
    actions = np.arange(8.0).reshape(2, 4)
    np.testing.assert_array_equal(exchange.actions(actions), [[2, 3, 0, 1], [6, 7, 4, 5]])
