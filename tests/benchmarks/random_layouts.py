"""Success on layouts that no setting was chosen on: random starts, goals and one to three obstacles anywhere between.

    uv run python tests/benchmarks/random_layouts.py pretrained outputs/training

Policies here were trained on simulated pairs and both seats act on one plan: none of these figures is a human result.
"""

import argparse

import numpy as np

from copolicy.evaluate.coplan.rollouts import coplan
from copolicy.evaluate.summary import success_rate
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld
from copolicy.train.checkpoint import Checkpoint

_APART = 50.0  # px, so that obstacles do not overlap


def layouts(count: int, seed: int) -> list[MapConfig]:
    """Maps with obstacles of 50 px at uniform places between start and goal, none at the start; all from the seed."""
    rng = np.random.default_rng(seed)
    maps = []
    while len(maps) < count:
        start, goal = (240.0, rng.uniform(100, 500), 3.14), (960.0, rng.uniform(150, 450))
        obstacles: list[tuple[float, float]] = []
        for _ in range(rng.integers(1, 4)):
            x, y = rng.uniform(400, 800), rng.uniform(50, 550)
            if all(max(abs(x - other[0]), abs(y - other[1])) > _APART for other in obstacles):
                obstacles.append((x, y))
        config = MapConfig(start, goal, tuple(obstacles), 50)
        if not any(TableWorld(config).contact(start)):
            maps.append(config)
    return maps


def main() -> None:
    """Prints a line for each policy."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("policies", nargs="+")
    parser.add_argument("--layouts", type=int, default=336)
    parser.add_argument("--seed", type=int, default=20261122)
    arguments = parser.parse_args()
    maps = layouts(arguments.layouts, arguments.seed)
    for policy in arguments.policies:
        outcomes = coplan(Checkpoint(policy), maps, Physics(step_limit=2000))
        rates = {"all": success_rate([outcome.success for outcome in outcomes])}
        for size in (1, 2, 3):
            chosen = [o.success for o in outcomes if len(o.scenario.obstacles) == size]
            rates[f"{size} obstacles"] = success_rate(chosen)
        shown = [
            f"{name} {100 * rate['mean']:.1f} ± {100 * rate['standard_error']:.1f} % of {rate['episodes']}"
            for name, rate in rates.items()
        ]
        print(policy, "; ".join(shown), flush=True)


if __name__ == "__main__":
    main()
