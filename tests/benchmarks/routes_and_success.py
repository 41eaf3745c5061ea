"""Success of policies on maps whose demonstrations take one route, and on maps where they take several.

    uv run python tests/benchmarks/routes_and_success.py --dataset DATASET --runs BC=outputs/rivals/runs/bc CoDP-H=DIR

A map of `holdout` has one route if at least 80 % of its demonstrations pass its obstacles on the same sides. The runs
were evaluated by `copolicy-eval table coplanning` or `rivals.py`. Maps with several routes also have more obstacles, so
the difference is that within maps of equally many, weighted by the harmonic mean of their counts; its standard error
is over maps. A method that loses more of the second maps than another has not learned to choose.
"""

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset import load_dataset
from copolicy.dataset.task import get_task

ONE_ROUTE = 0.8
"""Proportion of the commonest route from which on a map has one."""

Key = tuple[Any, ...]
"""Start, goal and obstacles of a map, in any order of the obstacles; rounded, since a data set has float32."""


def key(scenario: Any) -> Key:
    """The map of a scenario."""
    return (
        tuple(np.round(scenario.start, 1)),
        tuple(np.round(scenario.goal, 1)),
        frozenset(tuple(np.round(place, 1)) for place in scenario.obstacles),
    )


def commonest_route(dataset: Path) -> dict[Key, float]:
    """For each map of a data set the proportion of its commonest route."""
    routes: dict[Key, Counter[str]] = defaultdict(Counter)
    for episode in load_dataset(dataset).episodes:
        routes[key(episode.scenario)][episode.columns["route_class"]] += 1
    return {each: max(counts.values()) / counts.total() for each, counts in routes.items()}


def compare(success: Sequence[float], obstacles: Sequence[int], one_route: Sequence[bool]) -> dict[str, Any]:
    """Success rates of both kinds of maps, and their difference within maps of equally many obstacles.

    Args:
        success: of each map, the mean over its episodes.
        obstacles: number of obstacles of each map.
        one_route: the kind of each map.
    """
    values, numbers, one = np.array(success, float), np.array(obstacles), np.array(one_route, bool)
    strata: list[tuple[float, float, float]] = []  # weight, difference, variance
    for number in np.unique(numbers):
        groups = [values[(numbers == number) & kind] for kind in (one, ~one)]
        if min(map(len, groups)) > 1:
            weight = 1 / sum(1 / len(group) for group in groups)
            variance = sum(float(group.var(ddof=1)) / len(group) for group in groups)
            strata.append((weight, float(groups[1].mean() - groups[0].mean()), variance))
    weights, differences, variances = (np.array(column) for column in zip(*strata, strict=True))
    weights = weights / weights.sum()
    return {
        "one_route": {"mean": float(values[one].mean()), "maps": int(one.sum())},
        "several": {"mean": float(values[~one].mean()), "maps": int((~one).sum())},
        "difference": float(weights @ differences),
        "standard_error": float(np.sqrt(weights**2 @ variances)),
    }


def evaluated(folder: Path) -> list[list[bool]]:
    """Success on the holdout maps of each run in a folder."""
    files = sorted(folder.rglob("coplanning/holdout.json"))
    if not files:
        raise SystemExit(f"{folder}: expected runs evaluated on the holdout maps (coplanning/holdout.json), found none")
    results: list[Mapping[str, Any]] = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return [[bool(episode["success"]) for episode in result["episodes"]] for result in results]


def main() -> None:
    """Prints a Markdown table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", type=Path, required=True, help="the demonstrations, with every map of `holdout`")
    parser.add_argument("--runs", nargs="+", required=True, metavar="NAME=DIR", help="runs of one method each")
    arguments = parser.parse_args()
    maps, routes = get_task().scenario_set("holdout").scenarios, commonest_route(arguments.dataset)
    if any(key(scenario) not in routes for scenario in maps):
        raise SystemExit(f"{arguments.dataset}: expected demonstrations on every map of holdout, found some without")
    one_route = [routes[key(scenario)] >= ONE_ROUTE for scenario in maps]
    obstacles = [len(scenario.obstacles) for scenario in maps]
    print("| method | runs | one route, % | several, % | difference at equally many obstacles |")
    print("|---|---:|---:|---:|---:|")
    for text in arguments.runs:
        name, _, folder = text.partition("=")
        runs = evaluated(Path(folder))
        row = compare(np.mean(runs, axis=0).tolist(), obstacles, one_route)
        cells = [f"{100 * row[kind]['mean']:.1f} of {row[kind]['maps']}" for kind in ("one_route", "several")]
        print(
            f"| {name} | {len(runs)} | {' | '.join(cells)} | "
            f"{100 * row['difference']:+.1f} ± {100 * row['standard_error']:.1f} |"
        )


if __name__ == "__main__":
    main()
