"""Agents by name, for notebooks: `policy:pretrained`, `scripted:stubborn`, `replay:FILE`, `nothing`."""

from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import TABLE, PairTask, get_task

from ..rollout import Agent, EpisodeStart
from .checkpoint_folder import PRETRAINED, load_policy
from .policy import PolicyAgent
from .replay import ConstantAgent, ReplayAgent
from .scripted import ScriptedAgent
from .simulated_players import simulated_players

AGENT_KINDS = ("policy", "scripted", "replay", "nothing")


def make_agent(name: str, task: str = TABLE, **settings: Any) -> Agent:
    """Makes an agent for either seat of a rollout.

    Args:
        name: `policy:CHECKPOINT` (or `policy:pretrained`, the model that comes with the package); `scripted:NAME` of a
            simulated pair (its player at the agent's seat), of a kind of partner, or of a scripted robot;
            `replay:FILE` of a recording; `nothing`, whose action is always zero.
        task: name of the task; ignored for a policy, which has its own.
        settings: of a policy, see `load_policy`; of a simulated pair, `SimulatedPlayers.options` of the task.

    Raises:
        UnknownNameError: no such kind of agent, or no such simulated player.
        InvalidValueError: a file or checkpoint is missing from the name, or settings that the agent does not have.
        FileFormatError: no such checkpoint or recording.
        CopolicyError: the task has no simulated players.
    """
    kind, _, detail = name.partition(":")
    if kind not in AGENT_KINDS:
        raise UnknownNameError("agent", kind, AGENT_KINDS)
    if kind != "nothing" and not detail:
        example = {"policy": PRETRAINED, "scripted": "S01", "replay": "FILE"}[kind]
        raise InvalidValueError("agent", f"{kind}:{example}", name)
    if settings and kind in ("replay", "nothing"):
        raise InvalidValueError(name, "no settings", ", ".join(settings))
    if kind == "policy":
        device = settings.pop("device", "cpu")
        policy = load_policy(detail, device, settings)
        return PolicyAgent(policy, get_task(policy.task))
    pair_task = get_task(task)
    if kind == "scripted":
        return _scripted_agent(detail, pair_task, settings)
    if kind == "replay":
        return ReplayAgent(Path(detail), pair_task)
    return ConstantAgent(np.zeros(len(pair_task.spec.action)), "nothing")


def _scripted_agent(name: str, task: PairTask, settings: dict[str, Any]) -> Agent:
    players = simulated_players(task)
    if unknown := sorted(set(settings) - set(players.options if name in players.pairs else ())):
        raise InvalidValueError(f"scripted:{name}", "no such setting", ", ".join(unknown))
    if name in players.pairs:
        return ScriptedAgent.from_pair(name, task, **settings)
    if name not in (*players.partners, *players.robots):
        raise UnknownNameError("simulated player", name, (*players.pairs, *players.partners, *players.robots))
    is_partner = name in players.partners

    def make_player(seat: int, index: int, start: EpisodeStart) -> Any:
        if seat != is_partner:
            expected = f"the {'human' if is_partner else 'robot'}'s seat"
            raise InvalidValueError(f"scripted:{name}", expected, f"seat {seat}")
        make = players.make_partner if is_partner else players.make_robot
        return make(start.scenario, name, start.seed)

    return ScriptedAgent(f"scripted:{name}", make_player)
