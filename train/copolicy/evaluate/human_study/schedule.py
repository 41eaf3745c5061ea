"""What a session of the study plays next, and the robot behind it."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.collect.agents import PolicyController
from copolicy.collect.agents.policy import JointPlanner
from copolicy.collect.play.settings import PlaySettings
from copolicy.collect.session import Balance, Counts
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

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
    def physics(self) -> Physics:
        """The plan's."""
        return self.plan.physics

    def map_configs(self) -> tuple[MapConfig, ...]:
        """The plan's starts."""
        return self.plan.configurations

    def fixed(self) -> dict[str, Any]:
        """A session belongs to one plan."""
        return {"study_plan": self.plan.plan_id, "participant": self.pair}


class BlindPlanner:
    """Several robots behind one name: which of them plans changes between episodes, and nothing tells which it is.

    Attributes:
        frames: observations that the present one plans from.
    """

    name = CODE_PREFIX

    def __init__(self, planners: Mapping[str, JointPlanner], actions_per_plan: int):
        self.actions_per_plan = actions_per_plan
        self._planners = dict(planners)
        self._present = next(iter(self._planners.values()))
        self.frames = self._present.frames
        self._lock = threading.Lock()

    def choose(self, robot: str) -> None:
        """Puts a robot in charge, from the next episode on."""
        with self._lock:  # a plan that is still being made belongs to the episode before
            self._present = self._planners[robot]
            self.frames = self._present.frames

    @property
    def fps(self) -> int:
        """Frames a second of the present one's plans."""
        return self._present.fps

    def seed(self, seed: int) -> None:
        """Sets the source of noise."""
        with self._lock:
            self._present.seed(seed)

    def plan(self, history: dict[str, np.ndarray]) -> np.ndarray:
        """Plans with the present one."""
        with self._lock:
            return self._present.plan(history)


class StudySchedule(Balance):
    """Plays a participant's trials in their order; a discarded one comes again at once, the seats never change."""

    def __init__(self, plan: StudyPlan, participant: str, planner: BlindPlanner, controller: PolicyController):
        self._plan = plan
        self._participant = participant
        self._trials = plan.of(participant)
        self._planner = planner
        self._controller = controller
        super().__init__(plan.configurations, len(self._trials), plan.seed, participant, swap=False)

    def next(self, counts: Counts) -> tuple[MapConfig, int]:
        """Start and seats of the next trial; puts its robot in charge."""
        trial = self._trials[min(counts.kept_here.total(), len(self._trials) - 1)]
        return self._play(trial, trial.code), 0

    def practice(self, number: int) -> MapConfig:
        """A trial to get used to the stick: one robot after the other, on the participant's own starts."""
        blocks = list({trial.block: trial for trial in reversed(self._trials)}.values())[::-1]
        return self._play(blocks[number % len(blocks)], "practice")

    def _play(self, trial: PlannedTrial, code: str) -> MapConfig:
        self._planner.choose(trial.robot)
        self._controller.name = f"{CODE_PREFIX}:{self._plan.plan_id}:{self._participant}:{code}"
        self._controller.latencies.clear()  # the recording tells those of its own episode
        return self._plan.configurations[trial.configuration]
