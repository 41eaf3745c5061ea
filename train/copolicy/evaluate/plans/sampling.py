"""Many plans from one state: which ways does a co-policy see there?"""

from dataclasses import dataclass

import numpy as np

from copolicy.dataset import clock
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.routes import route_class

from ..coplan.rollouts import Outcome, PlannedTable, carry_on, histories
from ..planner import Planner


@dataclass(frozen=True)
class PlanSample:
    """One plan, and where it led.

    Attributes:
        plan: `(frames, 4)` joint actions, robot xy, human xy.
        planned_path: `(n, 2)` the table's centre while the whole plan is executed, and nothing else, px.
        outcome: the episode from the map's start to its end; after the plan's first actions the policy planned on.
    """

    plan: np.ndarray
    planned_path: np.ndarray
    outcome: Outcome

    @property
    def route(self) -> str | None:
        """The side word of its path; None where it did not reach the goal, since that route is not decided."""
        return route_class(self.outcome.path, self.outcome.map_config) if self.outcome.success else None


@dataclass(frozen=True)
class Decision:
    """A state and the plans sampled in it.

    Attributes:
        pose: (x, y, theta), px and rad.
        way: `(steps + 1, 2)` how the table came there from the map's start, px.
    """

    map_config: MapConfig
    pose: tuple[float, float, float]
    way: np.ndarray
    samples: tuple[PlanSample, ...]


def sample_plans(
    planner: Planner,
    config: MapConfig,
    physics: Physics,
    *,
    samples: int,
    seconds: float = 0.0,
    actions_per_plan: int = 8,
    fps: int = 10,
    seed: int = 0,
) -> Decision:
    """Samples plans in one state and lets the policy carry on from each, as in co-planning.

    Args:
        samples: number of plans.
        seconds: how long the policy carries before, to the nearest frame.
        actions_per_plan: actions executed before the next plan.
        fps: rate of the data set that the policy was trained on.

    Raises:
        RunError: the episode ended before `seconds`.
    """
    hold = clock.stride(fps)
    planner.seed(seed)
    table = _carried(planner, PlannedTable(0, config, 0, physics, planner.frames), round(seconds * fps), hold,
                     actions_per_plan)  # fmt: skip
    tables = [table.branch(number) for number in range(samples)]
    planner.actions, wanted = None, planner.actions
    plans = planner.plan(histories(tables))
    planner.actions = wanted
    planned_paths = []
    for branch, plan in zip(tables, plans, strict=True):
        planned_paths.append(_path_of(table, plan, hold))
        branch.plans += 1
        _execute(branch, plan[:actions_per_plan], hold)
    carry_on(planner, tables, actions_per_plan, hold)
    return Decision(
        config,
        table.world.pose,
        np.array(table.path),
        tuple(
            PlanSample(plan, path, branch.result())
            for plan, path, branch in zip(plans, planned_paths, tables, strict=True)
        ),
    )


def _carried(planner: Planner, table: PlannedTable, frames: int, hold: int, actions_per_plan: int) -> PlannedTable:
    while frames > 0:
        plan = planner.plan(histories([table]))[0][: min(frames, actions_per_plan)]
        table.plans += 1
        frames -= len(plan)
        _execute(table, plan, hold)
        if table.outcome is not None:
            ended = (len(table.path) - 1) / RECORD_HZ
            raise RunError(f"--seconds: expected a moment before the end, found one at {ended:.1f} s")
    return table


def _path_of(table: PlannedTable, plan: np.ndarray, hold: int) -> np.ndarray:
    branch = table.branch(0)
    _execute(branch, plan, hold)
    return np.array(branch.path[len(table.path) - 1 :])


def _execute(table: PlannedTable, actions: np.ndarray, hold: int) -> None:
    for action in actions:
        if table.outcome is None:
            table.execute(action, hold)
