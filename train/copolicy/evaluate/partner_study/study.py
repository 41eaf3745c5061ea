"""Runs a robot with every kind of partner from every start, all episodes in parallel."""

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copolicy.collect.agents import ScriptedAgent
from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.rollout import Rollout
from copolicy.dataset.task import PairTask, get_task

from ..coplan.rollouts import episode_measures, run_traced
from .episode_result import PartnerEpisodeResult
from .robots import StudyRobot


def run_with_partners(
    robot: StudyRobot,
    scenarios: Sequence[Any],
    partners: Sequence[str],
    settings: Any,
    *,
    task: PairTask | None = None,
    repeats: int = 1,
    fps: int = 10,
    seed: int = 0,
    partner_seed: int = 0,
    on_step: Callable[[int], object] = lambda finished: None,
) -> list[PartnerEpisodeResult]:
    """Runs a robot with every kind of partner from every start.

    Protocol (paper, section V-B): the robot predicts an action chunk at every frame, from the last frames including the
    current one, and holds the first action for record_hz / fps steps. The partner acts at every step. The simulation
    waits for inference, so a chunk is never late.

    Args:
        settings: settings of the world.
        task: the table if None.
        repeats: partners of each kind for each start, with different random numbers.
        fps: actions per second of the policy.
        seed: seed of the robot's random numbers.
        partner_seed: seed of the partners; equal seeds give every robot the same partners.
        on_step: called after each step with the number of finished episodes.

    Returns:
        One result for each scenario, kind and repeat, in that order.
    """
    task = task or get_task()
    players = simulated_players(task)
    episodes = [
        (index, scenario, kind, repeat)
        for index, scenario in enumerate(scenarios)
        for kind in partners
        for repeat in range(repeats)
    ]
    agent = robot.agent(seed, fps)
    partner = ScriptedAgent(
        "partner", lambda seat, index, start: players.make_partner(start.scenario, episodes[index][2], start.seed)
    )
    # The seeds depend on neither the robot nor the order of episodes: all robots get the same partner on a start.
    seeds = [_seed(partner_seed, scenario, repeat) for _, scenario, _, repeat in episodes]
    starts = [scenario for _, scenario, _, _ in episodes]
    rollout = Rollout(task, starts, (agent, partner), seeds=seeds, settings=settings)
    trace = run_traced(rollout, on_step)
    return [
        PartnerEpisodeResult(
            index,
            scenario,
            repeat,
            *episode_measures(rollout, trace, agent, k),
            kind,
            trace.actions(k),
            task.studies.at_rest(trace.states(k)[1:]),
            partner.players[k].changes,
            task=task,
            end=rollout.ends[k],
        )
        for k, (index, scenario, kind, repeat) in enumerate(episodes)
    ]


def _seed(partner_seed: int, scenario: Any, repeat: int) -> int:
    entropy = [partner_seed, zlib.crc32(scenario.digest.encode()), repeat]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
