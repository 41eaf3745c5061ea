"""How failed episodes end, a benchmark."""

import sys
from pathlib import Path

import numpy as np
import pytest

from copolicy.dataset.task import get_task
from copolicy.evaluate.partner_study.robots import scripted_robots
from copolicy.evaluate.partner_study.study import run_with_partners
from copolicy.evaluate.trajectories import Trajectory, write_trajectories
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import failures  # pyright: ignore[reportMissingImports]

RIGHTWARD = MapConfig((200.0, 300.0, 0.0), (1000.0, 300.0), ((600.0, 300.0), (800.0, 200.0)), 45)
LEFTWARD = MapConfig((1000.0, 300.0, 0.0), (200.0, 300.0), ((600.0, 300.0),), 45)


def failure(scenario: MapConfig, x: float, y: float = 300.0, reason: str = "collision_obstacle") -> Trajectory:
    """An episode that ends with the table's centre at (x, y)."""
    final = np.array([x, y, 1.0, 0.0, 0.0, 0.0, 0.0])
    return Trajectory(final[None], np.zeros((1, 4)), final, 30, scenario, {"reason": reason, "success": False})


@pytest.mark.parametrize(
    ("episode", "kind"),
    [
        (failure(RIGHTWARD, 567.0), "head-on"),  # the edge is at 577.5
        (failure(RIGHTWARD, 568.0), "beside"),
        (failure(RIGHTWARD, 630.0, 340.0), "beside"),
        (failure(RIGHTWARD, 740.0, 215.0), "head-on"),  # at the second obstacle
        (failure(LEFTWARD, 633.0), "head-on"),
        (failure(LEFTWARD, 632.0), "beside"),
        (failure(RIGHTWARD, 567.0, reason="collision_wall"), "wall"),
        (failure(RIGHTWARD, 567.0, reason="timeout"), "timeout"),
    ],
)
def test_kinds_of_failures(episode, kind):
    assert failures.kind_of_failure(episode) == kind


def test_failures_of_a_file_are_counted(tmp_path, monkeypatch, capsys):
    path = tmp_path / "result.trajectories.parquet"
    maps = get_task().scenario_set("unseen").scenarios[:2]
    episodes = run_with_partners(scripted_robots(get_task())["passive"], maps, ["follower"], Physics(step_limit=5))
    write_trajectories(path, get_task(), "simulated", [("passive", episode) for episode in episodes])
    monkeypatch.setattr(sys, "argv", ["failures.py", str(path)])
    failures.main()
    assert capsys.readouterr().out.splitlines()[-1] == "| result.trajectories.parquet | 2 | 2 | 0 | 0 | 0 | 2 |"
