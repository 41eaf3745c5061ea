"""Schedule of a study session: start and robot of each episode, with the robots hidden behind one name."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from copolicy.collect.agents import Policy, PolicyAgent
from copolicy.collect.play.settings import PlaySettings
from copolicy.collect.session import BalancedSchedule, EpisodeCounts
from copolicy.dataset.arrays import Array

from .plan import PlannedTrial, StudyPlan

CODE_PREFIX = "study"


@dataclass(frozen=True)
class StudySettings(PlaySettings):
    """Settings of a `copolicy-collect play` session on the starts of a plan; the pair is the participant."""

    plan: StudyPlan = field(kw_only=True)

    @property
    def world_settings(self) -> Any:
        """Settings of the world, from the plan."""
        return self.plan.world_settings

    @property
    def scenarios(self) -> tuple[Any, ...]:
        """The plan's starts."""
        return self.plan.configurations

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
        return self._play(trial, trial.code), 0

    def practice(self, number: int) -> Any:
        """Start of a practice episode: the robots in turn, on the participant's own starts."""
        blocks = list({trial.block: trial for trial in reversed(self._trials)}.values())[::-1]
        return self._play(blocks[number % len(blocks)], "practice")

    def _play(self, trial: PlannedTrial, code: str) -> Any:
        self._policy.choose(trial.robot)
        self._agent.name = f"{CODE_PREFIX}:{self._plan.plan_id}:{self._participant}:{code}"
        self._agent.latencies.clear()  # a recording has the latencies of its own episode only
        return self._plan.configurations[trial.configuration]
