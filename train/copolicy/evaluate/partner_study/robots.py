"""Who holds the robot's end in a study: a policy, or one of the floors that a policy has to beat."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.tasks.table.agents import Habits, ScriptedPilot
from copolicy.tasks.table.agents.partners import NEVER_YIELDS

from ..planner import Planner
from .table import PartnerTable


class Robot(Protocol):
    """Acts for the robot's seat at many tables at once.

    Attributes:
        name: in results.
        frames: observations of the history that it wants.
        planner: behind it; None for a scripted one.
    """

    name: str
    frames: int
    planner: Planner | None

    def begin(self, tables: Sequence[PartnerTable], seed: int) -> None:
        """All episodes begin."""
        ...

    def act(self, tables: Sequence[PartnerTable], frame: int, begins: bool) -> np.ndarray:
        """Forces `(B, 2)` for a step of 1/30 s; `begins` in the first step of a frame."""
        ...

    def describe(self) -> dict[str, Any]:
        """What it is, for the result."""
        ...


class PolicyRobot:
    """The robot's half of a policy's joint plans: one action of each plan (or more), held for the frame."""

    def __init__(self, name: str, planner: Planner, actions_per_plan: int = 1):
        self.name = name
        self.planner: Planner | None = planner
        self.frames = planner.frames
        self._policy = planner
        self._actions_per_plan = actions_per_plan
        self._plans: dict[PartnerTable, np.ndarray] = {}

    def begin(self, tables: Sequence[PartnerTable], seed: int) -> None:
        """Sets the source of the plans' noise."""
        self._policy.seed(seed)

    def act(self, tables: Sequence[PartnerTable], frame: int, begins: bool) -> np.ndarray:
        """Plans for all tables in one call where a plan is due; holds what was planned otherwise."""
        place = frame % self._actions_per_plan
        if begins and place == 0:
            maps = np.array([table.map_vector for table in tables])[:, None]
            history = {
                STATE: np.array([table.states for table in tables]),
                ENVIRONMENT_STATE: np.repeat(maps, self.frames, axis=1),
                HUMAN_ACTION: np.array([table.human for table in tables]),
            }
            self._plans = dict(zip(tables, self._policy.plan(history), strict=True))
            for table in tables:
                table.plans += 1
        return np.array([self._plans[table][place, :2] for table in tables])

    def describe(self) -> dict[str, Any]:
        """The policy's own description."""
        return self._policy.describe()


class PassiveRobot:
    """Does nothing: the partner carries alone."""

    name = "passive"
    frames = 1
    planner: Planner | None = None

    def begin(self, tables: Sequence[PartnerTable], seed: int) -> None:
        """Nothing to prepare."""

    def act(self, tables: Sequence[PartnerTable], frame: int, begins: bool) -> np.ndarray:
        """Zero."""
        return np.zeros((len(tables), 2))

    def describe(self) -> dict[str, Any]:
        """In words."""
        return {"type": "passive", "description": "zero force"}


class ScriptedRobot:
    """A scripted pilot at the robot's seat, acting at 30 Hz: it knows the map's ways as the partner does."""

    frames = 1
    planner: Planner | None = None

    def __init__(self, name: str, habits: Habits, description: str):
        self.name = name
        self._habits = habits
        self._description = description
        self._pilots: dict[PartnerTable, ScriptedPilot] = {}

    def begin(self, tables: Sequence[PartnerTable], seed: int) -> None:
        """A fresh mind for every table, with random numbers apart from the partner's."""
        self._pilots = {
            table: ScriptedPilot(0, table.map_config, self._habits, _apart(table.seed, seed)) for table in tables
        }

    def act(self, tables: Sequence[PartnerTable], frame: int, begins: bool) -> np.ndarray:
        """Asks each pilot."""
        return np.array([self._pilots[table].act(table.observation) for table in tables])

    def describe(self) -> dict[str, Any]:
        """In words and habits."""
        return {"type": "scripted", "description": self._description, "habits": asdict(self._habits)}


def _apart(table_seed: int, seed: int) -> int:
    return int(np.random.SeedSequence([table_seed, seed, 0]).generate_state(1)[0])


def passive() -> Robot:
    """A robot that applies no force."""
    return PassiveRobot()


def never_yields() -> Robot:
    """A robot that carries well along its own route and has endless patience."""
    return ScriptedRobot("never-yields", NEVER_YIELDS, "a clean scripted pilot with endless patience for its own route")


def scripted() -> Robot:
    """A robot that carries as simulated people do: what a policy that learned from them could reach."""
    return ScriptedRobot("scripted", Habits(), "a usual simulated pilot, who gives way: a reference, no floor")


SCRIPTED_ROBOTS = {"passive": passive, "never-yields": never_yields, "scripted": scripted}
"""Robots that `--baseline` knows by name."""
