"""The plan of a study with people: starts, set-ups and robots are counterbalanced."""

import json
from collections import Counter
from itertools import pairwise

import pytest
from human_plan import ROBOTS, SHORT

from copolicy.collect.questionnaire import read_questionnaire
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.task import get_task
from copolicy.evaluate.human_study.design import make_plan, williams_square
from copolicy.evaluate.human_study.plan import Robot, StudyPlan
from copolicy.evaluate.partner_study.configurations import front_configurations, study_configurations
from copolicy.tasks.table.map_config import MapConfig


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_every_condition_comes_everywhere_and_after_every_other_one(count):
    square = williams_square(count)
    rows = len(square)
    assert rows == (count if count % 2 == 0 else 2 * count)
    assert all(sorted(row) == list(range(count)) for row in square)
    for place in range(count):
        assert set(Counter(row[place] for row in square).values()) == {rows // count}
    after = Counter(pair for row in square for pair in pairwise(row))
    assert set(after.values()) == {rows // count}
    assert len(after) == count * (count - 1)


def test_a_plan_pairs_starts_within_a_person_and_counterbalances_robots():
    plan = make_plan(ROBOTS, "unseen", study_configurations("unseen", 60), 10, 12, 0)
    assert list(plan.trials) == [f"P{k:02d}" for k in range(1, 11)]
    firsts = Counter()
    for trials in plan.trials.values():
        assert [trial.block for trial in trials] == [1] * 12 + [2] * 12
        one, other = ([t for t in trials if t.block == block] for block in (1, 2))
        assert {t.robot for t in one} != {t.robot for t in other}
        assert {t.configuration for t in one} == {t.configuration for t in other}
        assert len({t.configuration for t in one}) == 12
        assert [t.configuration for t in one] != [t.configuration for t in other]
        assert len({t.code for t in trials}) == 24
        firsts[one[0].robot] += 1
    assert firsts == {"CoDP-H": 5, "CoDP": 5}
    used = Counter(t.configuration for trials in plan.trials.values() for t in trials)
    assert set(used.values()) == {4}
    assert len(used) == 60
    same = make_plan(ROBOTS, "unseen", study_configurations("unseen", 60), 10, 12, 0)
    other = make_plan(ROBOTS, "unseen", study_configurations("unseen", 60), 10, 12, 1)
    assert plan == same
    assert plan.plan_id != other.plan_id


@pytest.mark.parametrize("robots", [2, 3])
def test_set_ups_are_counterbalanced_with_the_robots_and_share_their_starts(robots):
    names = tuple(Robot(f"R{k}", "a", str(k)) for k in range(robots))
    task = get_task("table")
    fronts = task.studies.fronts
    starts = front_configurations(task.scenario_set("unseen"), 60, fronts)
    assert Counter(task.studies.front(start) for start in starts) == {"human_front": 30, "robot_front": 30}
    orders = 2 * len(williams_square(robots))
    plan = make_plan(names, "unseen", starts, orders, 4, 0, fronts)
    assert plan.fronts == fronts
    first, places = Counter(), Counter()
    for trials in plan.trials.values():
        own = {}
        for block, robot in {trial.block: trial.robot for trial in trials}.items():
            parts = [trial for trial in trials if trial.block == block]
            assert [trial.front for trial in parts] in ([a] * 2 + [b] * 2 for a, b in (fronts, fronts[::-1]))
            assert all(task.studies.front(starts[trial.configuration]) == trial.front for trial in parts)
            bases = [
                {(s := starts[t.configuration]).start[:2] + s.goal + s.obstacles for t in parts[k : k + 2]}
                for k in (0, 2)
            ]
            assert bases[0] == bases[1]
            own[robot] = {trial.configuration for trial in parts}
            first[robot, parts[0].front] += 1
            places[block, parts[0].front] += 1
        assert len({frozenset(indices) for indices in own.values()}) == 1
    assert set(first.values()) == {orders // 2}
    assert set(places.values()) == {orders // 2}
    with pytest.raises(InvalidValueError, match="--episodes-per-robot: expected 1 to 60, a multiple of 2, found 3"):
        make_plan(names, "unseen", starts, 1, 3, 0, fronts)


def test_a_plan_of_before_the_set_ups_and_questionnaires_keeps_its_id(tmp_path):
    plan = make_plan(ROBOTS, "custom", SHORT, 1, 2, 3, settings={"num_inference_steps": 5})
    content = plan.to_json()
    assert plan.plan_id == "dc2998f5"
    assert "questionnaires" not in content
    assert set(content["robots"][0]) == {"name", "checkpoint", "weights_sha256"}
    assert set(content["trials"]["P01"][0]) == {"code", "block", "robot", "configuration"}
    asked = make_plan(ROBOTS, "custom", SHORT, 1, 2, 3, questionnaires=(read_questionnaire("nasa-tlx"),))
    replace_json(tmp_path / "plan.json", asked.to_json())
    assert StudyPlan.read(tmp_path / "plan.json") == asked
    assert asked.plan_id != plan.plan_id


def test_a_plan_is_read_as_it_was_written_and_refused_when_changed(tmp_path):
    plan = make_plan(ROBOTS, "custom", SHORT, 1, 2, 3, settings={"num_inference_steps": 5})
    path = tmp_path / "plan.json"
    replace_json(path, plan.to_json())
    assert StudyPlan.read(path) == plan
    content = json.loads(path.read_text(encoding="utf-8"))
    content["trials"]["P01"][0]["robot"] = "CoDP"
    content["trials"]["P01"][1]["robot"] = "CoDP"
    content["trials"]["P01"][2]["robot"] = "CoDP-H"
    content["trials"]["P01"][3]["robot"] = "CoDP-H"
    content["seed"] = 4
    path.write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        StudyPlan.read(path)
    assert f"{path}: expected the plan {plan.plan_id} as it was made, found a changed one, " in str(error.value)
    path.write_text('{"study_plan": 1}', encoding="utf-8")
    with pytest.raises(FileFormatError, match="expected a plan of copolicy-eval human plan, found none: KeyError"):
        StudyPlan.read(path)


@pytest.mark.parametrize(("dx", "dy"), [(100.0, 100.0), (300.0, -300.0), (113.0, 113.0), (100.0, 0.0), (100.0, 37.0)])
def test_a_start_in_a_set_up_is_of_that_set_up_also_at_45_degrees(dx, dy):
    studies = get_task("table").studies
    scenario = MapConfig((400.0, 350.0, 0.3), (400.0 + dx, 350.0 + dy))
    for front in studies.fronts:
        assert studies.front(studies.with_front(scenario, front)) == front
