"""Human limits of agents: what comes late, how noise grows with the force; agents by world and random actions."""

import numpy as np
import pytest

from copolicy.collect.agents import AgentsByWorld, ConstantAgent, HumanLimits, LimitedAgent, RandomAgent, ScriptedAgent
from copolicy.collect.rollout import Agent, EpisodeStart, Rollout
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import get_task
from copolicy.tasks.table.agents import simulated_partner
from copolicy.tasks.table.maps import MAP_SETS

TABLE = get_task("table")
MAPS = MAP_SETS["training"][:3]


class Probe(Agent):
    """Remembers what it is shown; its force is a quarter of the step's number."""

    name = "probe"

    def begin(self, seat, starts):
        self.seen, self.heard, self.worlds = [], [], []

    def act(self, states, worlds):
        self.seen.append(states[:, 0].tolist())
        self.worlds.append(worlds.tolist())
        return np.full((len(states), 2), 0.25)

    def acted(self, actions, worlds):
        self.heard.append(actions.tolist())


def starts(count, size=7, seed=0):
    return [EpisodeStart(None, seed + index, np.full(size, -1.0 - index)) for index in range(count)]


def test_states_and_actions_come_late_and_the_start_before_them():
    probe = Probe()
    agent = LimitedAgent(probe, HumanLimits(delay_s=0.1), TABLE)  # three steps
    agent.begin(1, starts(2))
    both = np.arange(2)
    for step in range(6):
        worlds = both if step < 4 else both[1:]
        agent.act(np.full((len(worlds), 7), float(step)), worlds)
        agent.acted(np.full((len(worlds), 4), 10.0 + step), worlds)
    assert probe.seen == [[-1.0, -2.0]] * 3 + [[0.0, 0.0], [1.0], [2.0]]
    assert probe.heard[:3] == [[[0.0] * 4] * 2] * 3
    assert probe.heard[3:] == [[[10.0] * 4] * 2, [[11.0] * 4], [[12.0] * 4]]
    assert probe.worlds[-1] == [1]


def test_without_limits_an_agent_acts_as_it_does_alone():
    def run(limits):
        partner = ScriptedAgent("p", lambda seat, index, start: simulated_partner(start.scenario, "slow", 3))
        human = partner if limits is None else LimitedAgent(partner, limits, TABLE)
        rollout = Rollout(TABLE, MAPS[:1], (ConstantAgent(np.zeros(2)), human))
        rollout.run(60)
        return rollout.worlds[0].recorded

    assert run(None) == run(HumanLimits())
    assert run(None) != run(HumanLimits(delay_s=0.2))
    assert run(None) != run(HumanLimits(noise=0.3))


def test_noise_grows_with_the_force_and_depends_on_the_worlds_seed_alone():
    def deviations(size, noise=0.3, worlds=40, steps=200):
        agent = LimitedAgent(ConstantAgent(np.array([size, 0.0])), HumanLimits(noise=noise), TABLE)
        agent.begin(1, starts(worlds))
        every = np.arange(worlds)
        return np.array([agent.act(np.zeros((worlds, 7)), every) for _ in range(steps)]) - [size, 0.0]

    weak, strong = deviations(0.2), deviations(0.8)
    assert weak.std() == pytest.approx(0.3 * 0.2, rel=0.05)
    np.testing.assert_allclose(strong, 4 * weak)
    # Neighbouring steps are alike, steps half a second apart are not.
    first = strong[:, :, 0]
    assert np.corrcoef(first[:-1].ravel(), first[1:].ravel())[0, 1] == pytest.approx(np.exp(-1 / 3), abs=0.04)
    assert abs(np.corrcoef(first[:-15].ravel(), first[15:].ravel())[0, 1]) < 0.04
    np.testing.assert_array_equal(deviations(0.2, worlds=3), weak[:, :3])


@pytest.mark.parametrize("limits", [{"delay_s": -0.1}, {"noise": float("nan")}, {"delay_s": 3.0}])
def test_impossible_limits_are_refused(limits):
    with pytest.raises(InvalidValueError, match="expected a number from 0 to"):
        HumanLimits(**limits)


def test_agents_act_each_in_their_own_worlds():
    probes = [Probe(), Probe()]
    agent = AgentsByWorld(probes, [1, 0, 1])
    agent.begin(1, starts(3))
    states = np.arange(3.0)[:, None] * np.ones(7)
    assert agent.act(states, np.arange(3)).shape == (3, 2)
    agent.acted(np.arange(3.0)[:, None] * np.ones(4), np.arange(3))
    agent.act(states[2:], np.array([2]))
    assert probes[0].seen == [[1.0]]
    assert probes[1].seen == [[0.0, 2.0], [2.0]]
    assert probes[1].worlds == [[0, 1], [1]]
    assert probes[1].heard == [[[0.0] * 4, [2.0] * 4]]


def test_random_actions_are_held_within_bounds_and_repeat_with_their_seed():
    def run(seed):
        agent = RandomAgent(TABLE.spec.action, 3, seed)
        agent.begin(0, starts(2))
        return np.array([agent.act(np.zeros((2, 7)), np.arange(2)) for _ in range(300)])

    actions = run(0)
    np.testing.assert_array_equal(actions, run(0))
    assert (actions != run(1)).any()
    np.testing.assert_array_equal(actions[0::3], actions[2::3])
    assert (np.diff(actions[::3], axis=0) != 0).all()
    assert np.abs(actions).max() <= 1
    assert actions.std() == pytest.approx(1 / 3**0.5, abs=0.05)
