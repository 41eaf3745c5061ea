"""What a session of the study plays next, and the robot behind it."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.play.settings import PlaySettings
from copolicy.collect.session import BalancedSchedule, EpisodeCounts

from .plan import PlannedTrial, StudyPlan

CODE_PREFIX = "study"


@dataclass(frozen=True)
class StudySettings(PlaySettings):
    """A session of collect's `play` on the starts of a plan.

    Attributes:
        plan: of the study; the pair is the participant.
    """

    plan: StudyPlan = field(kw_only=True)

    @property
    def world_settings(self) -> Any:
        """The plan's."""
        return self.plan.physics

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """The plan's starts."""
        return self.plan.configurations

    def session_settings(self) -> dict[str, Any]:
        """A session belongs to one plan."""
        return {"study_plan": self.plan.plan_id, "participant": self.pair}


class BlindPolicy:
    """Several robots behind one name: which of them acts changes between episodes, and nothing tells which it is."""

    name = CODE_PREFIX

    def __init__(self, policies: Mapping[str, Policy], n_action_steps: int):
        self.n_action_steps = n_action_steps
        self._policies = dict(policies)
        self._present = next(iter(self._policies.values()))
        self._lock = threading.Lock()

    def choose(self, robot: str) -> None:
        """Puts a robot in charge, from the next episode on."""
        with self._lock:  # a chunk that is still being made belongs to the episode before
            self._present = self._policies[robot]

    def __getattr__(self, name: str) -> Any:
        """What else an agent asks of a policy: of the present one."""
        return getattr(self._present, name)

    def reset(self, seed: int) -> None:
        """Begins an episode of the present one."""
        with self._lock:
            self._present.reset(seed)

    def predict_action_chunk(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        """Predicts with the present one."""
        with self._lock:
            return self._present.predict_action_chunk(observations)


class StudySchedule(BalancedSchedule):
    """Plays a participant's trials in their order; a discarded one comes again at once, the seats never change."""

    def __init__(self, plan: StudyPlan, participant: str, policy: BlindPolicy, agent: PolicyAgent):
        self._plan = plan
        self._participant = participant
        self._trials = plan.of(participant)
        self._policy = policy
        self._agent = agent
        super().__init__(plan.configurations, len(self._trials), plan.seed, participant, swap=False, task=plan.task)

    def next(self, counts: EpisodeCounts) -> tuple[Any, int]:
        """Start and seats of the next trial; puts its robot in charge."""
        trial = self._trials[min(counts.kept_in_session.total(), len(self._trials) - 1)]
        return self._play(trial, trial.code), 0

    def practice(self, number: int) -> Any:
        """A trial to get used to the stick: one robot after the other, on the participant's own starts."""
        blocks = list({trial.block: trial for trial in reversed(self._trials)}.values())[::-1]
        return self._play(blocks[number % len(blocks)], "practice")

    def _play(self, trial: PlannedTrial, code: str) -> Any:
        self._policy.choose(trial.robot)
        self._agent.name = f"{CODE_PREFIX}:{self._plan.plan_id}:{self._participant}:{code}"
        self._agent.latencies.clear()  # the recording tells those of its own episode
        return self._plan.configurations[trial.configuration]
