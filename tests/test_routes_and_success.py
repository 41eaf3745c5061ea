"""Success on maps whose demonstrations take one route and several, a benchmark."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from copolicy.dataset.task import get_task

sys.path.append(str(Path(__file__).parent / "benchmarks"))

import routes_and_success  # pyright: ignore[reportMissingImports]


def test_kinds_of_maps_are_compared_within_equally_many_obstacles():
    """Not over all maps: those with several routes are most of the difficult ones."""
    one = [(0.9, 1, True), (0.9, 1, True), (0.8, 1, True), (0.4, 2, True), (0.3, 2, True)]
    several = [(0.7, 1, False), (0.6, 1, False), (0.2, 2, False), (0.1, 2, False), (0.15, 2, False), (0.0, 3, False)]
    columns = [np.array(column) for column in zip(*one, *several, strict=True)]
    contrast = routes_and_success.contrast(*columns)
    # At one obstacle 0.65 - 0.8667 and at two 0.15 - 0.35, each weighted by 1 / (1/3 + 1/2).
    assert contrast.mean == pytest.approx((0.65 - 2.6 / 3 - 0.2) / 2)
    variances = (0.01 / 3 / 3 + 0.005 / 2, 0.005 / 2 + 0.0025 / 3)
    assert contrast.standard_error == pytest.approx(sum(variances) ** 0.5 / 2)
    assert contrast.maps == 10
    with pytest.raises(SystemExit, match="two maps of each kind"):
        routes_and_success.contrast(columns[0], np.arange(11), columns[2])


def test_a_map_is_the_same_in_any_order_size_and_precision_of_its_obstacles():
    scenario = get_task().scenario_set("holdout").scenarios[-1]
    key = routes_and_success.map_key(scenario)
    assert len(scenario.obstacles) > 1
    stored = tuple((x + 1e-5, y - 1e-5) for x, y in scenario.obstacles[::-1])
    assert routes_and_success.map_key(replace(scenario, obstacles=stored, obstacle_size=50)) == key
    moved = ((1.0, 2.0), *scenario.obstacles[1:])
    assert routes_and_success.map_key(replace(scenario, obstacles=moved)) != key


def test_results_on_holdout_maps_are_averaged_by_map(tmp_path):
    scenarios = get_task().scenario_set("holdout").scenarios
    first = routes_and_success.map_key(scenarios[0])
    copies = [index for index, scenario in enumerate(scenarios) if routes_and_success.map_key(scenario) == first]
    for seed, succeeded in enumerate((copies[:1], copies)):
        episodes = [{"map_index": index, "success": index in succeeded} for index in range(len(scenarios))]
        file = tmp_path / f"seed_{seed}" / "coplanning" / "holdout.json"
        file.parent.mkdir(parents=True)
        file.write_text(json.dumps({"episodes": episodes}), encoding="utf-8")
    success = routes_and_success.holdout_success(tmp_path, scenarios)
    assert success.pop(first) == pytest.approx((1 + len(copies)) / (2 * len(copies)))
    assert set(success.values()) == {0.0}
    file = tmp_path / "seed_0" / "coplanning" / "holdout.json"
    file.write_text(json.dumps({"episodes": [{"map_index": 3, "success": True}]}), encoding="utf-8")
    with pytest.raises(SystemExit, match="one episode on each of 84 holdout maps"):
        routes_and_success.holdout_success(tmp_path, scenarios)
    with pytest.raises(SystemExit, match="expected runs evaluated on the holdout maps"):
        routes_and_success.holdout_success(tmp_path / "none", scenarios)
