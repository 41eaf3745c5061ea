"""How the failed episodes of a policy end: head-on at an obstacle, beside one, at a wall, or out of time.

    uv run copolicy-eval coplan --policy RUN --maps unseen --trajectories --out outputs/bc.json
    uv run python tests/benchmarks/failures.py outputs/bc.json

A contact with an obstacle is head-on if the centre of the table is more than `MARGIN` before the edge of the obstacle,
along x towards the goal; else the table is beside the obstacle or has passed it. The obstacle nearest to the centre
counts. For the table alone, whose maps are crossed along x.
"""

import argparse
import math
from collections import Counter
from pathlib import Path

from copolicy.dataset.arrays import Array
from copolicy.evaluate.trajectories import Trajectory, read_trajectories
from copolicy.tasks.table.map_config import MapConfig

MARGIN = 10.0
"""px; a contact with the centre of the table at most this far before the edge of the obstacle is "beside"."""

KINDS = {
    "head-on": "collision_obstacle",
    "beside": "collision_obstacle",
    "wall": "collision_wall",
    "timeout": "timeout",
}
"""Kinds of failures, and the reasons that the world gives for them."""


def kind_of_failure(episode: Trajectory) -> str:
    """One of `KINDS`, for an episode of the table that failed."""
    reason = episode.columns["reason"]
    kinds = [kind for kind, of_reason in KINDS.items() if of_reason == reason]
    if len(kinds) == 1:
        return kinds[0]
    return "head-on" if _distance_before_obstacle(episode.every_state[-1, :2], episode.scenario) > MARGIN else "beside"


def _distance_before_obstacle(centre: Array, scenario: MapConfig) -> float:
    """Distance in px along x from the centre of the table, `(2,)`, to the near edge of the nearest obstacle."""
    obstacle, size = min(scenario.squares, key=lambda square: math.dist(square[0], centre))
    towards_goal = 1 if scenario.goal[0] >= scenario.start[0] else -1
    return float(obstacle[0] - centre[0]) * towards_goal - size / 2


def main() -> None:
    """Prints a Markdown table, a line for each file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, help="results of copolicy-eval coplan --trajectories")
    arguments = parser.parse_args()
    print(f"| file | episodes | failures | {' | '.join(KINDS)} |\n|---|{'---:|' * (2 + len(KINDS))}")
    for file in arguments.files:
        found = read_trajectories(file)
        if (task := found.task.spec.name) != "table":
            raise SystemExit(f"{file}: expected trajectories of the task table, found {task}")
        counts = Counter(kind_of_failure(episode) for episode in found.episodes if not episode.columns["success"])
        cells = [len(found.episodes), counts.total(), *(counts[kind] for kind in KINDS)]
        print(f"| {file.name} | {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
