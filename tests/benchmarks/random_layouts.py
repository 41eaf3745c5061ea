"""Success on layouts that no setting was chosen on: random starts, goals and one to three obstacles anywhere between.

    uv run python tests/benchmarks/random_layouts.py pretrained outputs/training
    uv run python tests/benchmarks/random_layouts.py CoDP-H=outputs/rivals/runs/codp-h VRNN=outputs/rivals/runs/vrnn

`NAME=DIR` is a method with the runs of its training seeds. Differences to the first are over layouts (bootstrap), the
seeds of a layout together. Policies here were trained on simulated pairs and both seats act on one plan: none of these
figures is a human result.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from training_study import training_run

from copolicy.dataset.arrays import Array
from copolicy.evaluate.comparison.paired import between_runs, clustered_mean
from copolicy.evaluate.coplan.rollouts import coplan
from copolicy.evaluate.file_names import split_name
from copolicy.evaluate.summary import percent, success_rate
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


def policies_of(text: str) -> tuple[str, list[str]]:
    """Name and policies of an argument `POLICY` or `NAME=DIR`.

    Raises:
        SystemExit: the folder has no runs.
    """
    name, folder = split_name(text)
    if not name:
        return text, [text]
    runs = [str(training_run(path)) for path in sorted(Path(folder).iterdir()) if path.is_dir()]
    if not runs:
        raise SystemExit(f"{folder}: expected a folder for each training seed, found none")
    return name, runs


def rate(successes: Array) -> dict[str, Any]:
    """Success rate of `(seeds, layouts)`, with its standard error over seeds, of one seed over layouts (binomial)."""
    return between_runs(successes.mean(axis=1).tolist()) if len(successes) > 1 else success_rate(successes[0].tolist())


def line(name: str, successes: Array, first: Array | None, n_obstacles: Array) -> str:
    """A line of the table, with successes `(seeds, layouts)` of a method and of the first."""
    cells = [name, str(len(successes)), percent(rate(successes)), ""]
    if first is not None:
        found = clustered_mean(first.mean(axis=0) - successes.mean(axis=0), range(len(n_obstacles)))
        cells[-1] = f"{100 * found['mean']:+.1f} ± {100 * found['standard_error']:.1f}"
    cells += [percent(rate(successes[:, n_obstacles == number])) for number in np.unique(n_obstacles)]
    return f"| {' | '.join(cells)} |"


def evaluate(policies: Sequence[str], maps: Sequence[MapConfig]) -> Array:
    """Whether each policy succeeded on each map, `(policies, maps)`."""
    settings = Physics(step_limit=2000)
    return np.array([[result.success for result in coplan(Checkpoint(policy), maps, settings)] for policy in policies])


def main() -> None:
    """Prints a Markdown table, and writes the successes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policies", nargs="+", metavar="POLICY|NAME=DIR")
    parser.add_argument("--layouts", type=int, default=336)
    parser.add_argument("--seed", type=int, default=20261122)
    parser.add_argument("--out", type=Path, help="file (JSON) for the successes by method and seed")
    arguments = parser.parse_args()
    maps = layouts(arguments.layouts, arguments.seed)
    n_obstacles = np.array([len(scenario.obstacles) for scenario in maps])
    numbers = [f"{number} obst. ({(n_obstacles == number).sum()})" for number in np.unique(n_obstacles)]
    columns = ["policy", "seeds", "success", "first minus it", *numbers]
    print(f"{len(maps)} layouts of seed {arguments.seed}\n")
    print(f"| {' | '.join(columns)} |\n|---|{'---:|' * (len(columns) - 1)}")
    first: Array | None = None
    found: dict[str, Any] = {}
    for name, policies in map(policies_of, arguments.policies):
        successes = evaluate(policies, maps)
        print(line(name, successes, first, n_obstacles), flush=True)
        first = successes if first is None else first
        found[name] = successes.tolist()
        if arguments.out:
            content = {"seed": arguments.seed, "layouts": len(maps), "successes": found}
            arguments.out.write_text(json.dumps(content), encoding="utf-8")


if __name__ == "__main__":
    main()
