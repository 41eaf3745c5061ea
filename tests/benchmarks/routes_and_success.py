"""Success of policies on maps whose demonstrations take one route, and on maps where they take several.

    uv run python tests/benchmarks/routes_and_success.py --datasets outputs/rivals/data/pairs-sim-376 \\
        --methods CoDP-H=outputs/rivals/runs/codp-h BC=outputs/rivals/runs/bc-scan-10hz

A map of `holdout` has one route if at least 80 % of its demonstrations pass its obstacles on the same sides. The runs
were evaluated by `copolicy-eval table coplanning` or `rivals.py`. Maps with several routes have more obstacles, so the
difference is that within maps of equally many, weighted by the harmonic mean of the numbers of maps; standard errors
are over distinct maps. The last column compares it with that of the first method, map by map. The kinds also differ in
start and goal: a difference does not say why.
"""

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset import load_dataset
from copolicy.dataset.arrays import Array
from copolicy.dataset.task import get_task

ONE_ROUTE = 0.8
"""A map has one route if its commonest has at least this proportion of its demonstrations."""

MapKey = tuple[Any, ...]
"""Start, goal and obstacles of a map, whatever their order and size: those of the demonstrations are larger."""


class Contrast(NamedTuple):
    """Mean on maps with several routes minus that on maps with one, both with equally many obstacles.

    Attributes:
        mean: difference of the means.
        standard_error: over maps.
        maps: number of maps that have a counterpart.
    """

    mean: float
    standard_error: float
    maps: int


def map_key(scenario: Any) -> MapKey:
    """The map of a scenario; rounded, since data sets store float32."""
    return (
        tuple(np.round(scenario.start, 1)),
        tuple(np.round(scenario.goal, 1)),
        frozenset(tuple(np.round(centre, 1)) for centre in scenario.obstacles),
    )


def commonest_routes(datasets: Sequence[Path]) -> dict[MapKey, float]:
    """For each map the proportion of its commonest route among the successful episodes of all data sets."""
    routes: dict[MapKey, Counter[str]] = defaultdict(Counter)
    for dataset in datasets:
        for episode in load_dataset(dataset).episodes:
            if episode.columns["route_class"]:
                routes[map_key(episode.scenario)][episode.columns["route_class"]] += 1
    return {map_: max(counts.values()) / counts.total() for map_, counts in routes.items()}


def contrast(values: Array, n_obstacles: Array, is_one_route: Array) -> Contrast:
    """The contrast of values of maps, `(M,)`, within maps of equally many obstacles.

    Raises:
        SystemExit: no number of obstacles has two maps of each kind.
    """
    strata: list[tuple[float, float, float, int]] = []  # weight, difference, variance, maps
    for number in np.unique(n_obstacles):
        one, several = (values[(n_obstacles == number) & kind] for kind in (is_one_route, ~is_one_route))
        if min(len(one), len(several)) > 1:
            variance = float(one.var(ddof=1)) / len(one) + float(several.var(ddof=1)) / len(several)
            weight = 1 / (1 / len(one) + 1 / len(several))
            strata.append((weight, float(several.mean() - one.mean()), variance, len(one) + len(several)))
    if not strata:
        raise SystemExit("expected two maps of each kind with equally many obstacles, found none")
    weights, differences, variances, maps = (np.array(column) for column in zip(*strata, strict=True))
    weights = weights / weights.sum()
    return Contrast(float(weights @ differences), float(np.sqrt(weights**2 @ variances)), int(maps.sum()))


def holdout_success(folder: Path, scenarios: Sequence[Any]) -> dict[MapKey, float]:
    """Success of the runs in a folder on each distinct map of `holdout`, and that of all runs and episodes of a map.

    Raises:
        SystemExit: no run is evaluated, or one on other maps.
    """
    files = sorted(folder.rglob("coplanning/holdout.json"))
    if not files:
        raise SystemExit(f"{folder}: expected runs evaluated on the holdout maps (coplanning/holdout.json), found none")
    outcomes: dict[MapKey, list[bool]] = defaultdict(list)
    for file in files:
        episodes: list[Mapping[str, Any]] = json.loads(file.read_text(encoding="utf-8"))["episodes"]
        if [episode["map_index"] for episode in episodes] != list(range(len(scenarios))):
            raise SystemExit(f"{file}: expected one episode on each of {len(scenarios)} holdout maps, in order")
        for episode, scenario in zip(episodes, scenarios, strict=True):
            outcomes[map_key(scenario)].append(bool(episode["success"]))
    return {map_: float(np.mean(results)) for map_, results in outcomes.items()}


def main() -> None:
    """Prints a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--datasets", nargs="+", type=Path, required=True, help="demonstrations on all holdout maps")
    parser.add_argument("--methods", nargs="+", required=True, metavar="NAME=DIR", help="runs of one method each")
    arguments = parser.parse_args()
    scenarios, routes = get_task().scenario_set("holdout").scenarios, commonest_routes(arguments.datasets)
    n_obstacles = {map_key(scenario): len(scenario.obstacles) for scenario in scenarios}
    if missing := n_obstacles.keys() - routes.keys():
        raise SystemExit(f"--datasets: expected demonstrations on all maps of holdout, found none on {len(missing)}")
    numbers = np.array(list(n_obstacles.values()))
    is_one_route = np.array([routes[map_] >= ONE_ROUTE for map_ in n_obstacles])
    print(f"{is_one_route.sum()} maps with one route, {(~is_one_route).sum()} with several\n")
    print("| method | one route, % | several, % | difference | minus that of the first |\n|---|---:|---:|---:|---:|")
    first: Array | None = None
    compared = 0
    for method in arguments.methods:
        name, _, folder = method.partition("=")
        success = holdout_success(Path(folder), scenarios)
        values = np.array([success[map_] for map_ in n_obstacles])
        contrasts = [contrast(values, numbers, is_one_route)]
        if first is None:
            first = values
        else:
            contrasts.append(contrast(values - first, numbers, is_one_route))
        cells = [f"{100 * values[kind].mean():.1f}" for kind in (is_one_route, ~is_one_route)]
        cells += [f"{100 * each.mean:+.1f} ± {100 * each.standard_error:.1f}" for each in contrasts]
        print(f"| {name} | {' | '.join([*cells, ''][:4])} |")
        compared = contrasts[0].maps
    print(f"\nDifferences are within {compared} maps of which both kinds have two with equally many obstacles.")


if __name__ == "__main__":
    main()
