"""The partner score: what counts, its uncertainty over maps, methods of several training seeds, and who gave way."""

import numpy as np
import pytest

from copolicy.dataset.task import get_task
from copolicy.evaluate.cross_play.factors import by_factor
from copolicy.evaluate.cross_play.measures import own_kind_of_start, summary
from copolicy.evaluate.cross_play.methods import method_measures, method_scores
from copolicy.evaluate.cross_play.score import counts, gave_way, in_time, partner_scores, references
from copolicy.evaluate.partner_study.clearance import smallest_distance
from copolicy.tasks.table.maps import MAP_SETS

TABLE = get_task("table")
MAPS = MAP_SETS["training"]


def row(map_id, time_s, success=True, start=0):
    names = ("interaction_mean", "robot_share", "deadlock_s", "smallest_distance", "near_miss", "adaptations")
    values = dict.fromkeys(names)
    return {"map_index": start, "map_id": map_id, "time_s": time_s, "success": success, **values}


def test_a_success_counts_within_one_and_a_half_times_the_own_kinds_median_on_the_map():
    own = [row("a", 10.0), row("a", 20.0), row("b", 40.0, False), row("a-90deg", 90.0, False)]
    found = references(own)
    assert found is not None
    assert {name: found[name].time_s for name in ("a", "b")} == {"a": 15.0, "b": 15.0}  # no success on b: over all maps
    rows = [row("a", 22.5), row("a", 22.6), row("b", 22.0), row("a", 5.0, False)]
    assert [counts(each, found[each["map_id"]]) for each in rows] == [True, False, True, False]
    assert references([row("a", 1.0, False)]) is None


def test_a_success_against_the_partner_is_in_time_but_does_not_count():
    own = [{**row("a", 10.0), "interaction_mean": 0.1}, {**row("a", 10.0), "interaction_mean": 0.3}]
    found = references(own)
    assert found is not None
    assert found["a"].force == 0.2
    for force, expected in ((0.3, True), (0.31, False)):
        episode = {**row("a", 10.0), "interaction_mean": force}
        assert in_time(episode, found["a"])
        assert counts(episode, found["a"]) is expected


def test_times_relate_to_the_own_kind_on_the_same_start():
    times = own_kind_of_start([row("a", 10.0, start=0), row("a", 20.0, start=0), row("a", 50.0, False, start=1)])
    measured = summary([row("a", 30.0, start=0), row("a", 30.0, start=1), row("a", 60.0, False, start=0)], times)
    assert measured["relative_time"] == {"mean": 2.0, "standard_error": None, "n": 1}
    assert measured["time_s"] == {"mean": 30.0, "standard_error": 0.0, "n": 2}
    assert measured["success"] == {"mean": 2 / 3, "standard_error": pytest.approx((2 / 27) ** 0.5), "n": 3}
    assert measured["interaction_force"] is measured["relative_force"] is None
    spread = summary([row("a", 20.0), row("a", 40.0)], times)["time_s"]
    assert spread == {"mean": 30.0, "standard_error": pytest.approx(10.0), "n": 2}
    own = own_kind_of_start([{**row("a", 10.0), "interaction_mean": 0.2}])
    found = summary([{**row("a", 20.0, False), "interaction_mean": 0.5}], own)["relative_force"]
    assert found == {"mean": 2.5, "standard_error": None, "n": 1}


def test_scores_and_the_uncertainty_of_their_ranking_come_from_the_maps():
    names = [f"m{index}" for index in range(20)]
    own = {"p": [row(name, 10.0) for name in names]}
    good = {"p": [row(name, 10.0 if index < 14 else 90.0) for index, name in enumerate(names)]}
    near = {"p": [row(name, 10.0 if index >= 7 else 90.0) for index, name in enumerate(names)]}
    bad = {"p": [row(name, 90.0) for name in names]}
    found = partner_scores({"good": good, "near": near, "bad": bad}, own, ["good", "near", "bad"], ["bad"])
    robots = found["robots"]
    assert [robots[name]["mean"] for name in ("good", "near", "bad")] == [0.7, 0.65, 0.0]
    # A proportion of 20 independent maps.
    assert robots["good"]["standard_error"] == pytest.approx((0.7 * 0.3 / 20) ** 0.5, rel=0.03)
    assert robots["good"]["first"] > robots["near"]["first"] > 0.25
    assert robots["bad"]["first"] == 0
    assert sum(robots[name]["first"] for name in robots) == pytest.approx(1)
    assert set(found["separation"]) == {"good", "near"}
    apart = found["separation"]["good"]["bad"]
    assert apart["standard_errors"] == pytest.approx(0.7 / robots["good"]["standard_error"], rel=1e-6)
    assert partner_scores({"good": good}, {"p": [row("a", 1.0, False)]}, ["good"], []) == {}


def test_a_robot_with_the_own_kinds_times_is_first_with_certainty():
    own = {"p": [row("a", 10.0), row("b", 12.0)], "q": [row("a", 30.0), row("b", 30.0)]}
    bad = {"p": [row("a", 99.0), row("b", 99.0)], "q": [row("a", 99.0), row("b", 99.0)]}
    found = partner_scores({"same": own, "bad": bad}, own, ["same", "bad"], ["bad"])["robots"]
    assert (found["same"]["mean"], found["same"]["first"]) == (1.0, 1.0)
    assert found["same"]["by_partner"]["q"]["mean"] == 1.0


def test_a_method_has_the_mean_and_the_standard_error_of_its_training_seeds():
    own = {"p": [row("a", 10.0), row("b", 10.0), row("c", 10.0), row("d", 10.0)]}

    def carries(successes: str):
        return {"p": [row(name, 10.0, name in successes) for name in "abcd"]}

    # Scores of the seeds: 1 and 1/2 of one method, 1/2 and 1/4 of the other.
    rows = {"A-0": carries("abcd"), "A-1": carries("ab"), "B-0": carries("ab"), "B-1": carries("a"), "no": carries("")}
    scores = partner_scores(rows, own, list(rows), ["no"])
    times = own_kind_of_start(own["p"])
    summaries = {robot: {"p": {"measures": summary(cell["p"], times)}} for robot, cell in rows.items()}
    methods = {"A": ["A-0", "A-1"], "B": ["B-0", "B-1"]}
    found = method_scores(methods, scores, rows, own, ["no"])
    measured = method_measures(methods, summaries)["A"]
    assert found["A"]["score"] == {"mean": 0.75, "standard_error": pytest.approx(0.25), "n": 2}
    assert found["B"]["score"] == {"mean": 0.375, "standard_error": pytest.approx(0.125), "n": 2}
    assert measured["success"]["mean"] == 0.75
    assert measured["time_s"] == {"mean": 10.0, "standard_error": pytest.approx(0.0), "n": 2}
    assert found["A"]["differences"].keys() == {"no"}
    assert found["B"]["differences"].keys() == {"A", "no"}
    against = found["B"]["differences"]["A"]
    assert against["mean"] == pytest.approx(-0.375)
    # B minus A on each map, both seeds pooled; the bootstrap draws four of them.
    by_map = np.array([1 - 1, 0.5 - 1, 0 - 0.5, 0 - 0.5])
    assert against["standard_error"] == pytest.approx(by_map.std() / 2, rel=0.03)
    assert method_scores({}, scores, rows, own, ["no"]) == {}


def test_the_distance_to_an_obstacle_is_that_of_the_outlines():
    config = MAPS[0]
    (x, y), size = config.squares[0]

    def distance(*pose):
        return smallest_distance(TABLE, config, TABLE.states_of(np.array([[*pose, 0.0, 0.0, 0.0]])))

    # The board's right half beside the obstacle: the triangle's tip reaches to 95.5 px.
    assert distance(x - size / 2 - 95.5 - 12.0, y - 17.5, 0.0) == pytest.approx(12.0, abs=0.1)
    # The board's long side above it, which is 29.5 px from the centre.
    assert distance(x, y - size / 2 - 29.5 - 7.0, 0.0) == pytest.approx(7.0, abs=0.1)
    assert distance(x, y, 0.3) == 0.0
    path = np.array([[x - 400, y, 0.0], [x, y - size / 2 - 29.5 - 7.0, 0.0], [x, y - 300.0, 0.0]])
    states = TABLE.states_of(np.column_stack((path, np.zeros((3, 3)))))
    assert smallest_distance(TABLE, config, states) == pytest.approx(7.0, abs=0.1)


def adapted(map_id, robot, both, start=0):
    """An episode with `both` adaptations, in `robot` of which the robot gave way."""
    return {**row(map_id, 10.0, start=start), "adaptations": both, "robot_gave_way": robot}


def test_who_gave_way_is_a_mean_over_partners_of_the_episodes_with_an_adaptation():
    names = [f"m{index}" for index in range(20)]
    even = {
        "p": [adapted(name, index % 2, 1) for index, name in enumerate(names)],
        "q": [adapted(name, 1, 2) if index < 4 else adapted(name, 0, 0) for index, name in enumerate(names)],
    }
    never = {partner: [adapted(name, 0, 1) for name in names] for partner in "pq"}
    rests = {partner: [adapted(name, 0, 0) for name in names] for partner in "pq"}
    found = gave_way({"even": even, "rests": rests, "never": never}, ["even", "rests", "never"], ["rests", "never"])
    assert found["robots"].keys() == {"even", "never"}  # one that rests prefers no strategy
    assert (found["robots"]["even"]["mean"], found["robots"]["even"]["adaptations"]) == (0.5, 28)
    assert found["robots"]["never"]["mean"] == found["robots"]["never"]["standard_error"] == 0
    apart = found["separation"]["even"]["never"]
    assert found["separation"].keys() == {"even"}
    # Of partner p a proportion of 20 maps, half of the mean; of q each episode with one is a half.
    assert apart["standard_error"] == pytest.approx((0.25 / 20) ** 0.5 / 2, rel=0.05)
    assert apart["standard_errors"] == pytest.approx(0.5 / apart["standard_error"])
    assert gave_way({"rests": rests}, ["rests"], []) == {}


def test_a_partner_without_an_adaptation_has_no_part_in_who_gave_way():
    names = [f"m{index}" for index in range(12)]
    cell = {"p": [adapted(name, 1, 1) for name in names], "q": [adapted(name, 0, 0) for name in names]}
    estimate = gave_way({"a": cell}, ["a"], [])["robots"]["a"]
    assert (estimate["mean"], estimate["standard_error"], estimate["bootstrap_95"]) == (1.0, 0.0, [1.0, 1.0])
    measured = summary(cell["q"], own_kind_of_start(None))
    assert measured["gave_way"] is None
    measured = summary([adapted("a", 1, 2), adapted("b", 1, 1)], own_kind_of_start(None))
    assert measured["gave_way"] == {"mean": 0.75, "standard_error": pytest.approx(0.25), "n": 2}


def test_who_gave_way_is_compared_over_the_partners_with_which_both_had_adaptations():
    """Both never yield to p; only one met a q with whom it disagreed."""
    names = [f"m{index}" for index in range(12)]
    none, never, always = ([adapted(name, *counts) for name in names] for counts in ((0, 0), (0, 1), (1, 1)))
    cells = {"a": {"p": never, "q": always}, "b": {"p": never, "q": none}, "c": {"p": none, "q": never}}
    found = gave_way(cells, ["a", "b"], ["b", "c"])
    assert [found["robots"][robot]["mean"] for robot in "abc"] == [0.5, 0.0, 0.0]
    assert found["separation"].keys() == {"a"}
    assert found["separation"]["a"]["b"]["mean"] == 0.0
    assert found["separation"]["a"]["c"]["mean"] == 1.0
    assert gave_way(cells, ["b"], ["c"])["separation"] == {"b": {}}


def test_the_own_kind_of_some_partners_leaves_the_others_in_who_gave_way():
    """A task without an exchange of seats has no own kind of its scripted partners."""
    names = [f"m{index}" for index in range(12)]
    always, never = ([adapted(name, robot, 1) for name in names] for robot in (1, 0))
    none = [adapted(name, 0, 0) for name in names]
    cells = {"own-kind": {"p": none}, "a": {"p": never, "q": always}, "b": {"p": none, "q": always}}
    found = gave_way(cells, ["a", "b"], [])["robots"]
    assert {robot: (found[robot]["mean"], found[robot]["adaptations"]) for robot in found} == {
        "a": (0.5, 24),
        "b": (1.0, 12),
    }
    cells["own-kind"] = {"p": always}
    assert gave_way(cells, ["a", "b"], [])["robots"]["own-kind"]["mean"] == 1.0


def test_one_map_with_an_adaptation_gives_no_error():
    """Every replicate that draws it is the same."""
    cell = {"p": [adapted("m0", 1, 1), *(adapted(f"m{index}", 0, 0) for index in range(1, 9))]}
    again = {"p": [adapted(f"m{index}", index % 2, 1) for index in range(9)]}
    found = gave_way({"a": cell, "b": again}, ["a"], ["b"])
    assert found["robots"]["a"] == {"mean": 1.0, "standard_error": None, "bootstrap_95": None, "adaptations": 1}
    assert found["robots"]["b"]["standard_error"] > 0
    assert found["separation"]["a"]["b"]["standard_errors"] is None


def test_scores_are_given_for_each_value_of_a_factor_of_the_starts():
    """Good in one orientation alone: the mean over both would hide it."""
    turns = (0.0, 3.14159265)

    def cell(times):
        return [
            {**adapted(f"m{index}-{turn:.0f}deg", 0, 0), "time_s": time, "start_theta": turn, "obstacles": 1}
            for turn, time in zip(turns, times, strict=True)
            for index in range(10)
        ]

    own = {"p": cell((10.0, 10.0))}
    rows = {"A-0": {"p": cell((99.0, 10.0))}, "A-1": {"p": cell((99.0, 10.0))}, "B-0": {"p": cell((10.0, 10.0))}}
    methods = {"A": ["A-0", "A-1"], "B": ["B-0"]}
    found = by_factor(["start_theta", "obstacles"], rows, own, list(rows), [], methods)
    assert found.keys() == {"start_theta"}  # all have one obstacle
    assert list(found["start_theta"]) == ["0", "3.142"]
    means = {value: each["robots"]["A-0"]["mean"] for value, each in found["start_theta"].items()}
    assert means == {"0": 0.0, "3.142": 1.0}
    differences = [each["methods"]["B"]["differences"]["A"]["mean"] for each in found["start_theta"].values()]
    assert differences == [1.0, 0.0]
    # A value that some maps lack: only the others are drawn.
    halves = {"p": [{**row, "obstacles": int(row["map_id"][1]) % 2} for row in own["p"]]}
    one = by_factor(["obstacles"], {"B-0": halves}, halves, ["B-0"], [], {})["obstacles"]["1"]
    assert (one["maps"], one["robots"]["B-0"]["mean"], one["robots"]["B-0"]["standard_error"]) == (5, 1.0, 0.0)


def of_values(values, time_s=10.0):
    """Cell of an episode for each value of a factor, on a map of its own."""
    return [{**adapted(f"m{index}", 0, 0), "time_s": time_s, "factor": value} for index, value in enumerate(values)]


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([3, 1, 10, 1.0], ["1", "3", "10"]),
        ([0.0, -0.0, 1e-17, 0.0005, 0.001], ["0", "0.0005", "0.001"]),
        (["narrow", "a|b", "narrow"], ["a|b", "narrow"]),
        ([True, False, None], ["false", "true"]),
        ([(1, 2), "wide", 7, [1, 2]], ["7", "[1, 2]", "wide"]),
        ([None, None], []),
        ([1, 1, 1], []),
        ([index / 100 for index in range(13)], []),
    ],
)
def test_a_factor_may_have_any_values(values, expected):
    own = {"p": of_values(values)}
    rows = {"good": {"p": of_values(values)}, "late": {"p": of_values(values, 99.0)}}
    found = by_factor(["factor", "unknown"], rows, own, ["good", "late"], ["late"], {})
    assert found.keys() == ({"factor"} if expected else set())
    assert list(found.get("factor", {})) == expected
    for each in found.get("factor", {}).values():
        assert (each["robots"]["good"]["mean"], each["robots"]["late"]["mean"]) == (1.0, 0.0)


def test_the_scores_by_a_factor_are_over_the_same_partners_for_every_value():
    """A recording has its own starts: a value that it alone has would compare partners."""
    own = {"p": of_values([0, 1, 0, 1]), "q": of_values([1, 0, 1, 0]), "replay": of_values([0.3, 1])}
    lost = [{**row, "success": False} for row in of_values([5, 6])]
    own = {"replay": own.pop("replay"), **own, "weak": lost}
    rows = {"robot": {**own, "q": of_values([1, 0, 1, 0], 99.0)}}
    found = by_factor(["factor"], rows, own, ["robot"], [], {})["factor"]
    assert list(found) == ["0", "1"]
    assert all(each["robots"]["robot"]["by_partner"].keys() == {"p", "q"} for each in found.values())
    assert [each["robots"]["robot"]["mean"] for each in found.values()] == [0.5, 0.5]
    many = {**own, "p": of_values(range(13)), "q": of_values(range(13))}
    assert list(by_factor(["factor"], {"robot": many}, many, ["robot"], [], {})["factor"]) == ["0.3", "1"]
    assert by_factor(["factor"], {"robot": {"weak": lost}}, {"weak": lost}, ["robot"], [], {}) == {}
