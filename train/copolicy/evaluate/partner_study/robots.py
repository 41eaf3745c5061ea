"""Agents at the robot's seat in a study: a policy, or one of the scripted baselines.

    [NAME=]CHECKPOINT[,past_human_action=zero]   a policy; with the option, shown zeros as its partner's past action
nothing, random, ...                         a scripted robot
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.collect.agents import ConstantAgent, PolicyAgent, RandomAgent, ScriptedAgent
from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.rollout import Agent, EpisodeStart
from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.features import HUMAN_ACTION
from copolicy.dataset.task import PairTask, Player, get_task

from ..file_names import split_name
from ..study_flags import study_policy

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

PASSIVE, RANDOM = "passive", "random"
NOTHING = "nothing"
"""Another name of `PASSIVE`."""

_RANDOM_HOLD_S = 0.1
HIDDEN_OPTION = ",past_human_action=zero"
"""After a checkpoint: the policy is shown zeros as its partner's past action."""
HIDDEN_HELP = f"CKPT{HIDDEN_OPTION} is shown zeros as the partner's past action"


@dataclass(frozen=True)
class StudyRobot:
    """A robot of a study.

    Attributes:
        name: name in results.
        agent: makes its agent from a seed and the actions per second of a policy.
        describe: returns its description for the result.
        policy: its policy; None for a scripted robot.
    """

    name: str
    agent: Callable[[int, int], Agent]
    describe: Callable[[], Mapping[str, Any]]
    policy: "Checkpoint | None" = None


def robot_rate(robot: StudyRobot, fps: int | None, task: PairTask) -> int:
    """Actions per second of a robot.

    Args:
        fps: that of all policies; None for the rate of each policy's training data.

    Returns:
        The rate of a policy; for a robot without one, that of the steps, as it acts at each of them.
    """
    if robot.policy is None:
        return task.spec.record_hz
    return robot.policy.fps if fps is None else fps


def policy_robot(name: str, policy: "Checkpoint") -> StudyRobot:
    """A robot that executes its half of a policy's joint action chunks."""
    task = get_task(policy.task)
    return StudyRobot(name, lambda seed, fps: PolicyAgent(policy, task, fps=fps, seed=seed), policy.describe, policy)


def hidden_partner_robot(name: str, policy: "Checkpoint") -> StudyRobot:
    """`policy_robot`, shown zeros in place of the partner's past actions.

    Raises:
        InvalidValueError: the policy does not observe them.
    """
    if not getattr(policy.policy.config, "past_human_action", False):
        expected = "a policy that observes the human's past action (config.json: past_human_action)"
        raise InvalidValueError(name, expected, "one that does not")
    task = get_task(policy.task)
    shown: Any = _HidesPartner(policy)
    return StudyRobot(
        name,
        lambda seed, fps: PolicyAgent(shown, task, fps=fps, seed=seed),
        lambda: {**policy.describe(), "shown_past_human_action": "zero"},
        policy,
    )


class _HidesPartner:
    """A policy that is shown zeros as the partner's past actions; otherwise the policy itself."""

    def __init__(self, policy: "Checkpoint"):
        self._policy = policy

    def __getattr__(self, name: str) -> Any:
        return getattr(self._policy, name)

    def predict_action_chunk(self, observations: dict[str, Array]) -> Array:
        hidden = np.zeros_like(observations[HUMAN_ACTION])
        return self._policy.predict_action_chunk({**observations, HUMAN_ACTION: hidden})


def scripted_robots(task: PairTask) -> dict[str, StudyRobot]:
    """The robots that have a name: zero force, the task's scripted robots, and random actions."""
    zero = np.zeros(len(task.spec.action))
    passive = StudyRobot(
        PASSIVE, lambda seed, fps: ConstantAgent(zero, PASSIVE), lambda: {"type": PASSIVE, "description": "zero force"}
    )
    names = task.agents.robots if task.agents is not None else ()
    return {PASSIVE: passive, **{name: _scripted(task, name) for name in names}, RANDOM: _random(task)}


def _random(task: PairTask) -> StudyRobot:
    hold = max(1, round(_RANDOM_HOLD_S * task.spec.record_hz))
    description = f"uniformly random actions, each held for {_RANDOM_HOLD_S:g} s"
    return StudyRobot(
        RANDOM,
        lambda seed, fps: RandomAgent(task.spec.action, hold, seed),
        lambda: {"type": RANDOM, "description": description},
    )


def _scripted(task: PairTask, name: str) -> StudyRobot:
    players = simulated_players(task)
    profile, description = players.robots[name]

    def agent(seed: int, fps: int) -> Agent:
        def make(seat: int, index: int, start: EpisodeStart) -> Player:
            # Independent of the partner's random numbers, which come from `start.seed` alone.
            robot_seed = np.random.SeedSequence([start.seed, seed, 0]).generate_state(1)[0]
            return players.make_robot(start.scenario, name, int(robot_seed))

        return ScriptedAgent(name, make)

    return StudyRobot(name, agent, lambda: {"type": "scripted", "description": description, "habits": asdict(profile)})


def make_robot(text: str, arguments: argparse.Namespace, scripted: Mapping[str, StudyRobot]) -> StudyRobot:
    """The robot named by `[NAME=]CKPT[,past_human_action=zero]` or by the name of a scripted robot.

    Raises:
        FileFormatError: the checkpoint does not exist.
        InvalidValueError: its chunks have fewer actions than are to be executed, or it does not observe the partner's
            past action and this is to be hidden.
    """
    if text in scripted:
        return scripted[text]
    if text == NOTHING:
        return replace(scripted[PASSIVE], name=NOTHING)
    name, path, hides = split_robot(text)
    policy = study_policy(path, arguments)
    if hides:
        return hidden_partner_robot(name or policy.name + HIDDEN_OPTION, policy)
    return policy_robot(name or policy.name, policy)


def split_robot(text: str) -> tuple[str, str, bool]:
    """Splits `NAME=PATH,past_human_action=zero` into name (empty without one), path, and whether it has the option."""
    hides = text.endswith(HIDDEN_OPTION)
    return (*split_name(text.removesuffix(HIDDEN_OPTION)), hides)
