"""A robot with every kind of partner from every start, all episodes side by side."""

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copolicy.collect.agents import ScriptedAgent
from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.rollout import Rollout
from copolicy.dataset.task import PairTask, get_task

from ..coplan.rollouts import measured, traced_to_the_end
from .outcome import PartnerOutcome
from .robots import Robot


def carry_with_partners(
    robot: Robot,
    maps: Sequence[Any],
    partners: Sequence[str],
    physics: Any,
    *,
    task: PairTask | None = None,
    repeats: int = 1,
    fps: int = 10,
    seed: int = 0,
    partner_seed: int = 0,
    on_step: Callable[[int], object] = lambda finished: None,
) -> list[PartnerOutcome]:
    """Lets a robot carry the table (or whatever the task is) with every kind of partner from every start.

    Protocol (paper, section V-B): the robot plans at every frame, from the last frames' observations, of which the
    newest is the present one; it holds the first action for record_hz / fps steps. The partner acts at every step. The
    world waits for a plan, which on a real clock would come a little later.

    Args:
        task: the table if None.
        repeats: partners of each kind on each start, with different random numbers.
        fps: rate of the data set that the policy was trained on.
        seed: of the robot's random numbers.
        partner_seed: of the partners'; equal ones give every robot the same partners.
        on_step: called after each step with the number of finished episodes.

    Returns:
        One outcome for each map, kind and repeat, in that order.
    """
    task = task or get_task()
    players = simulated_players(task)
    episodes = [
        (index, config, kind, repeat)
        for index, config in enumerate(maps)
        for kind in partners
        for repeat in range(repeats)
    ]
    scenarios = [config for _, config, _, _ in episodes]
    agent = robot.agent(seed, fps)
    partner = ScriptedAgent(
        "partner", lambda seat, index, start: players.make_partner(start.scenario, episodes[index][2], start.seed)
    )
    # Neither the robot nor the order of episodes is in it: every robot meets the same partner on the same start.
    seeds = [_seed(partner_seed, config, repeat) for _, config, _, repeat in episodes]
    rollout = Rollout(task, scenarios, (agent, partner), seeds=seeds, settings=physics)
    trace = traced_to_the_end(rollout, on_step)
    return [
        PartnerOutcome(
            index,
            config,
            repeat,
            *measured(rollout, trace, agent, place),
            kind,
            trace.actions(place),
            task.studies.at_rest(trace.states(place)[1:]),
            partner.players[place].changes,
            task=task,
            end=rollout.ends[place],
        )
        for place, (index, config, kind, repeat) in enumerate(episodes)
    ]


def _seed(partner_seed: int, config: Any, repeat: int) -> int:
    entropy = [partner_seed, zlib.crc32(config.digest.encode()), repeat]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
