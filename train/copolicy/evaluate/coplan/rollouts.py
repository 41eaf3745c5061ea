"""The paper's co-planning study: both players act on one sampled plan, on every map of a set at once.

Protocol (paper, section V-A): from the last To observations a joint plan is sampled, its first actions are executed,
then the next plan is sampled. A plan lives at the data set's rate, so each of its actions is held for 30 / fps steps
of the world (the original program's evaluation skips that hold and plays a 10 Hz plan three times too fast).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from copolicy.dataset import clock
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.features import environment_state
from copolicy.tasks.table.interaction import interaction_force
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import identify
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

from ..planner import Planner


@dataclass(frozen=True)
class Outcome:
    """One episode of a study.

    Attributes:
        path: `(steps + 1, 2)` the table's centre, px.
        interaction: `(steps,)` interaction force, units of a player's full force.
    """

    map_index: int
    map_config: MapConfig
    repeat: int
    success: bool
    reason: str
    plans: int
    path: np.ndarray
    interaction: np.ndarray

    @property
    def steps(self) -> int:
        """Steps of 1/30 s."""
        return len(self.interaction)

    def to_json(self) -> dict:
        """The row of `eval.json`."""
        size = np.abs(self.interaction)
        return {
            "map_index": self.map_index,
            "map_id": identify(self.map_config)[0],
            "start_theta": self.map_config.start[2],
            "obstacles": len(self.map_config.obstacles),
            "repeat": self.repeat,
            "success": self.success,
            "reason": self.reason,
            "steps": self.steps,
            "time_s": self.steps / RECORD_HZ,
            "plans": self.plans,
            "interaction_mean": float(size.mean()),
            "interaction_p95": float(np.quantile(size, 0.95)),
        }


class PlannedTable:
    """One world with the history that the policy sees of it.

    Attributes:
        path: the table's centre, from the start on, px.
        outcome: how it ended; None while it is carried.
    """

    def __init__(self, map_index: int, config: MapConfig, repeat: int, physics: Physics, length: int):
        self.map_index, self.repeat = map_index, repeat
        self.world = TableWorld(config, physics)
        self.map_vector = environment_state(config)
        # Before the start there is nothing: the first observation is repeated, as it is padded in training.
        self.states = [self.world.observation] * length
        self.human = [np.zeros(2)] * length
        self.path = [self.world.pose[:2]]
        self.interaction: list[float] = []
        self.plans = 0
        self.outcome = None

    def branch(self, repeat: int) -> "PlannedTable":
        """The same table with the same past, to go on in another way."""
        table = PlannedTable(self.map_index, self.world.map_config, repeat, self.world.physics, len(self.states))
        table.world.reset(self.world.pose, self.world.velocity)
        table.world.step_count = self.world.step_count
        table.states, table.human = list(self.states), list(self.human)
        table.path, table.interaction = list(self.path), list(self.interaction)
        table.plans, table.outcome = self.plans, self.outcome
        return table

    def execute(self, action: np.ndarray, hold: int) -> None:
        """Holds one action, then observes, unless the episode ends on the way."""
        action = np.clip(action, -1.0, 1.0)
        for _ in range(hold):
            outcome = self.world.step(action)
            self.path.append(self.world.pose[:2])
            self.interaction.append(float(interaction_force(self.world.pose[2], action)))
            if outcome.done:
                self.outcome = outcome
                return
        self.states = [*self.states[1:], self.world.observation]
        self.human = [*self.human[1:], action[2:]]

    def result(self) -> Outcome:
        assert self.outcome is not None
        return Outcome(
            self.map_index,
            self.world.map_config,
            self.repeat,
            self.outcome.success,
            self.outcome.reason,
            self.plans,
            np.array(self.path),
            np.array(self.interaction),
        )


def coplan(
    planner: Planner,
    maps: Sequence[MapConfig],
    physics: Physics,
    *,
    repeats: int = 1,
    actions_per_plan: int = 8,
    fps: int = 10,
    seed: int = 0,
    on_plan: Callable[[int], object] = lambda finished: None,
) -> list[Outcome]:
    """Runs every map `repeats` times, all of them through one call of the policy a plan.

    Args:
        actions_per_plan: actions executed before the next plan.
        fps: rate of the data set that the policy was trained on.
        on_plan: called after each round with the number of finished episodes.

    Returns:
        One outcome for each map and repeat, in that order.
    """
    hold = clock.stride(fps)
    tables = [PlannedTable(i, m, r, physics, planner.frames) for i, m in enumerate(maps) for r in range(repeats)]
    planner.seed(seed)
    carry_on(planner, tables, actions_per_plan, hold, on_plan)
    return [table.result() for table in tables]


def carry_on(
    planner: Planner,
    tables: Sequence[PlannedTable],
    actions_per_plan: int,
    hold: int,
    on_plan: Callable[[int], object] = lambda finished: None,
) -> None:
    """Plans for all tables at once and executes, until each has come to its end."""
    while running := [table for table in tables if table.outcome is None]:
        plans = planner.plan(histories(running))
        for table, plan in zip(running, plans, strict=True):
            table.plans += 1
            for action in plan[:actions_per_plan]:
                table.execute(action, hold)
                if table.outcome is not None:
                    break
        on_plan(sum(table.outcome is not None for table in tables))


def histories(tables: Sequence[PlannedTable]) -> dict[str, np.ndarray]:
    """What the policy sees of each table: observation keys to `(B, To, n)`."""
    states = np.array([table.states for table in tables])  # (B, To, 7)
    maps = np.array([table.map_vector for table in tables])[:, None]  # (B, 1, 11)
    return {
        STATE: states,
        ENVIRONMENT_STATE: np.repeat(maps, states.shape[1], axis=1),
        HUMAN_ACTION: np.array([table.human for table in tables]),
    }
