"""Runs a robot with every kind of partner from every start, all episodes in parallel."""

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from copolicy.collect.agents import AgentsByWorld, LimitedAgent, ScriptedAgent
from copolicy.collect.rollout import Rollout
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask, get_task

from ..coplan.rollouts import episode_fields, run_traced
from ..partners.partner import StudyPartner, scripted_partners
from .episode_result import PartnerEpisodeResult
from .robots import StudyRobot


def run_with_partners(
    robot: StudyRobot,
    scenarios: Sequence[Any],
    partners: Sequence["str | StudyPartner"],
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
        scenarios: of the study; replaced by the recorded starts of a `replay`, which must be the only partner.
        partners: partners, or names of scripted kinds.
        settings: settings of the world.
        task: the table if None.
        repeats: partners of each kind for each start, with different random numbers.
        fps: actions per second of the policy.
        seed: seed of the robot's random numbers.
        partner_seed: seed of the partners; equal seeds give every robot the same partners.
        on_step: called after each step with the number of finished episodes.

    Returns:
        One result for each scenario, kind and repeat, in that order.

    Raises:
        InvalidValueError: a `replay` beside other partners.
    """
    task = task or get_task()
    chosen = [scripted_partners([each], task)[0] if isinstance(each, str) else each for each in partners]
    recorded = next((each.recorded for each in chosen if each.recorded is not None), None)
    if recorded is not None and len(chosen) > 1:
        names = [each.name for each in chosen]
        raise InvalidValueError("--partners", "a replay as the only partner, since it acts in its own starts", names)
    scenarios = scenarios if recorded is None else recorded.scenarios
    episodes = [
        (index, scenario, owner, repeat)
        for index, scenario in enumerate(scenarios)
        for owner in range(len(chosen))
        for repeat in range(repeats)
    ]
    agent = robot.agent(seed, fps)
    partner = AgentsByWorld(
        [each.agent(partner_seed, repeats) for each in chosen], [owner for _, _, owner, _ in episodes], "partner"
    )
    # The seeds depend on neither the robot nor the order of episodes: all robots get the same partner on a start.
    seeds = [_seed(partner_seed, scenario, repeat) for _, scenario, _, repeat in episodes]
    starts = [scenario for _, scenario, _, _ in episodes]
    worlds = () if recorded is None else recorded.worlds(task, settings, repeats)
    rollout = Rollout(task, starts, (agent, partner), seeds=seeds, settings=settings, worlds=worlds)
    trace = run_traced(rollout, on_step)
    return [
        PartnerEpisodeResult(
            index,
            scenario,
            repeat,
            partner=chosen[owner].name,
            still=task.studies.at_rest(trace.states(k)[1:]),
            partner_changes=_changes(partner, k),
            **episode_fields(rollout, trace, agent, k),
        )
        for k, (index, scenario, owner, repeat) in enumerate(episodes)
    ]


def _changes(partner: AgentsByWorld, world: int) -> int | None:
    """How often a scripted partner changed its route choice; None for other partners."""
    agent = partner.agents[partner.owners[world]]
    agent = agent.inner if isinstance(agent, LimitedAgent) else agent
    return agent.players[partner.local[world]].changes if isinstance(agent, ScriptedAgent) else None


def _seed(partner_seed: int, scenario: Any, repeat: int) -> int:
    entropy = [partner_seed, zlib.crc32(scenario.digest.encode()), repeat]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
