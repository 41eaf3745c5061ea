"""How the failed episodes of a policy end: head-on at an obstacle, beside one, at a wall, or out of time.

    uv run copolicy-eval coplan --policy RUN --maps unseen --trajectories --out outputs/bc.json
    uv run python tests/benchmarks/failures.py outputs/bc.trajectories.parquet

A table that ends at an obstacle met it head-on if its centre is still before the obstacle, seen from the start towards
the goal along x, by more than half the obstacle and `MARGIN`; else it is beside it or has passed it. The nearest
obstacle counts.
"""

import argparse
import math
from collections import Counter
from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.evaluate.trajectories import Trajectory, read_trajectories
from copolicy.tasks.table.map_config import MapConfig

MARGIN = 10.0
"""px between the centre of the table and the near edge of an obstacle, from which on the table is beside it."""

KINDS = ("head-on", "beside", "wall", "timeout")


def kind_of_failure(episode: Trajectory) -> str:
    """One of `KINDS`, for an episode of the table that failed in a study."""
    reason = str(episode.columns["reason"])
    if reason != "collision_obstacle":
        return {"collision_wall": "wall", "timeout": "timeout"}[reason]
    return _meeting(episode.every_state[-1, :2], episode.scenario)


def _meeting(centre: Array, scenario: MapConfig) -> str:
    """How a table with its centre at `(2,)` met the nearest obstacle."""
    middle, size = min(scenario.squares, key=lambda square: math.dist(square[0], centre))
    ahead = (middle[0] - centre[0]) * np.sign(scenario.goal[0] - scenario.start[0])
    return "head-on" if ahead > size / 2 + MARGIN else "beside"


def main() -> None:
    """Prints a Markdown table, a line for each file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+", type=Path, help="trajectories of copolicy-eval coplan --trajectories")
    arguments = parser.parse_args()
    print(f"| file | episodes | failures | {' | '.join(KINDS)} |\n|---|{'---:|' * (2 + len(KINDS))}")
    for file in arguments.files:
        episodes = read_trajectories(file).episodes
        counts = Counter(kind_of_failure(episode) for episode in episodes if not episode.columns["success"])
        cells = [len(episodes), counts.total(), *(counts[kind] for kind in KINDS)]
        print(f"| {file.name} | {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
