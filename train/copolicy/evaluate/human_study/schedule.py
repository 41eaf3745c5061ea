"""Schedule of a study session: start and robot of each episode, with the robots hidden behind one name."""

import json
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.play.interludes import Interlude
from copolicy.collect.play.settings import PlaySettings
from copolicy.collect.session import BalancedSchedule, EpisodeCounts
from copolicy.dataset.arrays import Array

from .plan import StudyPlan

CODE_PREFIX = "study"


@dataclass(frozen=True)
class StudySettings(PlaySettings):
    """Settings of a `copolicy-collect play` session on the starts of a plan; the pair is the participant.

    Attributes:
        break_s: shortest break between two blocks, s; none if 0.
    """

    plan: StudyPlan = field(kw_only=True)
    break_s: float = 0.0

    @property
    def world_settings(self) -> Any:
        """Settings of the world, from the plan."""
        return self.plan.world_settings

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """The plan's starts."""
        return self.plan.configurations

    def interludes(self) -> tuple[Interlude, ...]:
        """The plan's questionnaires, and a break, after each block."""
        trials = self.plan.trials_of(self.pair)
        ends = {trial.block: number for number, trial in enumerate(trials, 1)}
        return tuple(Interlude(block, end, self.plan.questionnaires, self.break_s) for block, end in ends.items())

    def session_settings(self) -> dict[str, Any]:
        """What must not change when a session is continued: plan and participant."""
        return {"study_plan": self.plan.plan_id, "participant": self.pair}


class BlindPolicy:
    """Several policies behind one name; the acting one changes between episodes without being shown."""

    name = CODE_PREFIX

    def __init__(self, policies: Mapping[str, Policy], n_action_steps: int):
        self.n_action_steps = n_action_steps
        self._policies = dict(policies)
        self._current = next(iter(self._policies.values()))
        self._lock = threading.Lock()

    def choose(self, robot: str) -> None:
        """Selects the robot that acts from the next episode on."""
        with self._lock:  # inference for the previous episode may still be running
            self._current = self._policies[robot]

    def __getattr__(self, name: str) -> Any:
        """Other attributes are those of the current policy."""
        return getattr(self._current, name)

    def reset(self, seed: int) -> None:
        """Resets the current policy at the start of an episode."""
        with self._lock:
            self._current.reset(seed)

    def predict_action_chunk(self, observations: dict[str, Array]) -> Array:
        """Predicts with the current policy."""
        with self._lock:
            return self._current.predict_action_chunk(observations)


class StudySchedule(BalancedSchedule):
    """A participant's trials in order; a discarded trial is repeated at once, and seats are never swapped."""

    in_order = True

    def __init__(self, plan: StudyPlan, participant: str, policy: BlindPolicy, agent: PolicyAgent):
        self._plan = plan
        self._participant = participant
        self._trials = plan.trials_of(participant)
        self._policy = policy
        self._agent = agent
        super().__init__(plan.configurations, len(self._trials), plan.seed, participant, swap=False, task=plan.task)

    def next(self, counts: EpisodeCounts) -> tuple[Any, int]:
        """Start and seats of the next trial; selects its robot."""
        trial = self._trials[min(counts.kept_in_session.total(), len(self._trials) - 1)]
        return self._play(trial.robot, trial.configuration, trial.code, trial.block), 0

    def practice(self, number: int) -> Any:
        """Start of a practice episode: the robots and the set-ups in turn, on starts of other participants if any."""
        plan, own = self._plan, {trial.configuration for trial in self._trials}
        fronts = plan.fronts or ("",)
        front = fronts[number % len(fronts)]
        fitting = [
            index
            for index, scenario in enumerate(plan.configurations)
            if not front or plan.task.studies.front(scenario) == front
        ]
        spare = [index for index in fitting if index not in own] or fitting
        order = np.random.default_rng([plan.seed, *self._participant.encode(), 1 << 20]).permutation(len(spare))
        robots = list(plan.blocks_of(self._participant).values())
        return self._play(robots[number % len(robots)], spare[int(order[number % len(spare)])], "practice", 0)

    def _play(self, robot: str, configuration: int, code: str, block: int) -> Any:
        plan, scenario = self._plan, self._plan.configurations[configuration]
        self._policy.choose(robot)
        self._agent.name = f"{CODE_PREFIX}:{plan.plan_id}:{self._participant}:{code}"
        # The front follows from the start, also in a plan whose starts are not dealt by set-up.
        front = plan.task.studies.front(scenario) if plan.task.studies.fronts else ""
        self.planned = json.dumps(
            {"plan": plan.plan_id, "participant": self._participant, "trial": code, "block": block, "front": front}
        )
        return scenario
