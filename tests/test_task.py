import json
import math
from collections import Counter
from dataclasses import replace
from itertools import combinations

import pytest

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.task import MAP_SETS, MapConfig, Physics, identify, map_set


def test_map_sets_have_the_sizes_of_the_paper():
    assert {name: len(maps) for name, maps in MAP_SETS.items()} == {
        "training": 84,
        "paper36": 108,
        "holdout": 84,
        "unseen": 84,
        "varied": 1080,
    }
    assert len(set(MAP_SETS["training"])) == 84
    assert {config.obstacle_size for config in MAP_SETS["training"]} == {50}
    assert {config.obstacle_size for config in (*MAP_SETS["holdout"], *MAP_SETS["unseen"])} == {45}


def test_paper36_is_36_configurations_with_equal_shares_and_every_set_of_obstacles():
    maps = MAP_SETS["paper36"]
    assert set(maps) == set(MAP_SETS["training"])
    configurations = Counter((config.start, config.goal, len(config.obstacles)) for config in maps)
    assert len(configurations) == 36
    assert set(configurations.values()) == {3}
    # One of three sets where there is a choice, the only one of three obstacles three times.
    for count, times in ((1, 1), (2, 1), (3, 3)):
        assert set(Counter(config for config in maps if len(config.obstacles) == count).values()) == {times}
    assert {identify(config)[1] for config in maps} == {"training"}


def test_varied_maps_are_half_the_papers_and_half_random_layouts_that_nothing_is_judged_on():
    maps = MAP_SETS["varied"]
    assert set(maps[:540]) == set(MAP_SETS["paper36"])
    layouts = maps[540:]
    assert len({(config.start, config.goal, config.obstacles) for config in layouts}) == 540
    judged = {frozenset(config.obstacles) for name in ("holdout", "unseen") for config in MAP_SETS[name]}
    assert not judged & {frozenset(config.obstacles) for config in layouts}
    assert {len(config.obstacles) for config in layouts} == {1, 2, 3}
    for config in layouts:
        assert all(400 <= x <= 800 and 50 <= y <= 550 for x, y in config.obstacles)
        for one, other in combinations(config.obstacles, 2):
            assert max(abs(one[0] - other[0]), abs(one[1] - other[1])) >= 49.8, "they overlap"
    # Frozen: a recipe's name stands for the same episodes in every version.
    assert layouts[0] == MapConfig(
        (240.0, 231.5, 3.14), (960.0, 445.0), ((767.3, 445.0), (750.0, 50.2), (650.8, 173.8)), 50
    )
    assert identify(layouts[0])[0] == "varied-540"


@pytest.mark.parametrize(("name", "key"), [("holdout", "holdout_84_nominal_seed88"), ("unseen", "unseen_84")])
def test_evaluation_maps_are_the_frozen_lists(upstream, name, key):
    frozen = json.loads((upstream / "maps.json").read_text(encoding="utf-8"))["expanded"][key]
    for config, entry in zip(MAP_SETS[name], frozen, strict=True):
        x, y, theta = entry["table"]
        assert config.start == (x * 1200, y * 600, theta)
        assert config.goal == (entry["goal"][0] * 1200, entry["goal"][1] * 600)
        assert config.obstacles == tuple((x * 1200, y * 600) for x, y in entry["obstacles"])


def test_orientations_give_four_starts_a_map():
    maps = map_set("unseen", orientations=True)
    assert len(maps) == 4 * 84
    assert [config.start[2] for config in maps[:4]] == [0.0, math.pi / 2, math.pi, 3 * math.pi / 2]
    assert len({config.start[:2] for config in maps[:4]}) == 1


def test_an_unknown_set_lists_what_is_available():
    with pytest.raises(UnknownNameError) as error:
        map_set("validation")
    assert str(error.value) == "unknown map set 'validation'; available: holdout, paper36, training, unseen, varied"


def test_identify_ignores_the_order_of_obstacles():
    config = MAP_SETS["training"][6]
    shuffled = replace(config, obstacles=config.obstacles[::-1])
    assert identify(config) == identify(shuffled) == ("training-06", "training")
    assert identify(replace(config, goal=(1.0, 2.0)))[1] == "custom"


def test_identify_knows_the_start_orientations():
    names = [identify(config) for config in map_set("unseen", orientations=True)]
    assert names[:4] == [(f"unseen-00-{degrees}deg", "unseen") for degrees in (0, 90, 180, 270)]
    assert len(set(names)) == 4 * 84


def test_map_survives_json():
    config = MAP_SETS["unseen"][5]
    assert MapConfig.from_json(config.to_json()) == config


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"start": 1, "goal": 2, "obstacles": 3, "obstacle_size": 4}'])
def test_what_is_no_map_is_refused(text):
    with pytest.raises(InvalidValueError, match=r"^map: expected JSON with start, goal, obstacles and obstacle_size"):
        MapConfig.from_json(text)


def test_a_map_takes_at_most_three_obstacles():
    with pytest.raises(InvalidValueError, match=r"MapConfig.obstacles: expected at most 3, found 4"):
        MapConfig((0, 0, 0), (1, 1), ((1, 1), (2, 2), (3, 3), (4, 4)))


def test_a_map_of_no_number_is_refused():
    with pytest.raises(InvalidValueError, match="finite positions"):
        MapConfig((math.nan, 0, 0), (1, 1))


def test_physics_refuses_a_limit_of_zero():
    with pytest.raises(InvalidValueError, match="angular_acceleration_limit: expected a positive number, found 0"):
        Physics(angular_acceleration_limit=0)
