"""Agents by name, as a notebook writes them: `policy:pretrained`, `scripted:stubborn`, `replay:FILE`, `nothing`."""

from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import TABLE, PairTask, get_task

from ..rollout import Agent, Start
from .checkpoint_folder import PRETRAINED, load_policy
from .policy import PolicyAgent
from .replay import HeldAgent, ReplayAgent
from .scripted import ScriptedAgent
from .simulated import simulated_players

KINDS = ("policy", "scripted", "replay", "nothing")


def make_agent(name: str, task: str = TABLE, **settings: Any) -> Agent:
    """An agent for either seat of a rollout.

    Args:
        name: `policy:CHECKPOINT` (or `policy:pretrained`, the model that comes with the package); `scripted:NAME` of a
            simulated pair, whose player it is that belongs to the seat, of a kind of partner, or of a scripted robot;
            `replay:FILE` of a recording; `nothing` never acts.
        task: name of the task; a policy brings its own.
        settings: of a policy, see `load_policy`; of a simulated pair, the task's own (`SimulatedPlayers.options`).

    Raises:
        UnknownNameError: no such kind of agent, or no such simulated player.
        InvalidValueError: a file or checkpoint is not named, or settings that the agent does not have.
        FileFormatError: no such checkpoint or recording.
        CopolicyError: the task has no simulated players.
    """
    kind, _, detail = name.partition(":")
    if kind not in KINDS:
        raise UnknownNameError("agent", kind, KINDS)
    if kind != "nothing" and not detail:
        example = {"policy": PRETRAINED, "scripted": "S01", "replay": "FILE"}[kind]
        raise InvalidValueError("agent", f"{kind}:{example}", name)
    if settings and kind in ("replay", "nothing"):
        raise InvalidValueError(name, "no settings", ", ".join(settings))
    if kind == "policy":
        device = settings.pop("device", "cpu")
        policy = load_policy(detail, device, settings)
        return PolicyAgent(policy, get_task(policy.task))
    found = get_task(task)
    if kind == "scripted":
        return _scripted(detail, found, settings)
    if kind == "replay":
        return ReplayAgent(Path(detail), found)
    return HeldAgent(np.zeros(len(found.spec.action)), "nothing")


def _scripted(name: str, task: PairTask, settings: dict[str, Any]) -> Agent:
    players = simulated_players(task)
    if unknown := sorted(set(settings) - set(players.options if name in players.pairs else ())):
        raise InvalidValueError(f"scripted:{name}", "no such setting", ", ".join(unknown))
    if name in players.pairs:
        return ScriptedAgent.of_pair(name, task, **settings)
    if name not in (*players.partners, *players.robots):
        raise UnknownNameError("simulated player", name, (*players.pairs, *players.partners, *players.robots))
    make = players.make_partner if name in players.partners else players.make_robot

    def player(seat: int, index: int, start: Start) -> Any:
        if seat != (name in players.partners):
            own = "human's" if name in players.partners else "robot's"
            raise InvalidValueError(f"scripted:{name}", f"the {own} seat", f"seat {seat}")
        return make(start.scenario, name, start.seed)

    return ScriptedAgent(f"scripted:{name}", player)
