"""The human study: its design, its statistics, and a session with a simulated player at the human seat."""

import json
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from play_session import settings
from untrained_policy import save_untrained_policy, untrained_robots

from copolicy.collect.play.result import ResultPhase
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.questionnaire import Answer, AnswerFile, read_questionnaire
from copolicy.collect.session import EpisodeCounts, iter_recordings
from copolicy.collect.simulate.command import simulate
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.human_study.design import make_plan, williams_square
from copolicy.evaluate.human_study.plan import Robot, StudyPlan
from copolicy.evaluate.human_study.ratings import read_ratings, study_ratings
from copolicy.evaluate.human_study.schedule import BlindPolicy, StudySchedule
from copolicy.evaluate.human_study.session import require_planned_weights, run_session
from copolicy.evaluate.human_study.summary import summarise_study
from copolicy.evaluate.partner_study.configurations import front_configurations, study_configurations
from copolicy.tasks.table.map_config import MapConfig

SHORT = tuple(MapConfig((803.0, y, 3.14), (960.0, y)) for y in (250.0, 350.0))
"""Straight ahead, about a second away."""


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


ROBOTS = (Robot("CoDP-H", "a", "1"), Robot("CoDP", "b", "2"))


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


def _rows(source="human"):
    """Three people, two robots, two episodes each: the first robot is better, by another amount for each person."""
    return [
        {
            "participant": f"P0{person}", "robot": robot, "source": source, "success": not (robot == "B" and k < gap),
            "time_s": 10.0 + person + (gap + 1 if robot == "B" else 0), "interaction_mean": 0.1 * (1 + (robot == "B")),
            "interaction_p95": 0.3, "planning_ms": None,
        }
        for person, gap in ((1, 0), (2, 1), (3, 2))
        for robot in "AB"
        for k in range(2)
    ]  # fmt: skip


def test_a_summary_is_within_persons_and_says_who_they_were():
    summary = summarise_study(_rows())
    assert summary["label"] == "human-in-the-loop study: people at the human seat"
    a, b = summary["robots"]["A"], summary["robots"]["B"]
    assert (a["success"]["mean"], b["success"]["mean"]) == (1.0, 0.5)
    assert b["success"]["standard_error"] == pytest.approx(0.5 / np.sqrt(3))
    assert (b["time_s"]["mean"], b["time_s"]["participants"]) == (13.0, 2)  # the third never succeeded with B
    assert a["planning_ms"] == {"mean": None, "sd": None, "standard_error": None, "participants": 0}
    assert summary["tests"]["success"]["anova"][0]["F"] == pytest.approx(3.0)
    assert len(summary["tests"]["time_s"]["units"]) == 2
    assert summary["tests"]["interaction_mean"]["anova"] is None  # the same difference for everybody: no spread
    assert summary["tests"]["interaction_mean"]["tukey"][0]["difference"] == pytest.approx(-0.1)
    assert summarise_study(_rows("simulated"))["label"].startswith("SIMULATED")


def test_people_and_simulated_players_are_not_mixed():
    with pytest.raises(Exception, match="expected one source, found human and simulated: summarise them apart"):
        summarise_study([*_rows(), *_rows("simulated")])


def test_ratings_get_their_robot_from_the_plan(tmp_path):
    plan = make_plan(ROBOTS, "custom", SHORT, 2, 1, 0)
    path = tmp_path / "ratings.csv"
    path.write_text("participant,block,fluent,trust\nP01,1,6,5\nP01,2,4,\nP02,1,3,4\nP02,2,7,4\n", encoding="utf-8")
    ratings = read_ratings(path, plan)
    assert [row["robot"] for row in ratings] == [
        next(t.robot for t in plan.trials_of(row["participant"]) if t.block == row["block"]) for row in ratings
    ]
    assert ratings[1]["trust"] is None
    summary = summarise_study(_rows(), ratings)["ratings"]
    assert list(summary) == ["fluent", "trust"]
    assert {robot["participants"] for robot in summary["fluent"]["robots"].values()} == {2}
    assert sum(robot["mean"] for robot in summary["fluent"]["robots"].values()) == pytest.approx(10.0)
    path.write_text("participant,block,fluent\nP01,1,good\n", encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        read_ratings(path, plan)
    assert str(error.value) == f"{path}: expected a number for 'fluent' in row 1, found 'good'"
    path.write_text("participant,block,fluent\nP01,3,1\n", encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        read_ratings(path, plan)
    assert str(error.value) == f"{path}: expected blocks of plan {plan.plan_id}, found P01 block 3 in row 1"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("block,participant,fluent\n1,P01,3,5\n", "found more values than columns in row 1"),  # a comma in a number
        ("participant,block,fluent\nP01,1.5,3\n", "expected the number of a block in row 1, found '1.5'"),
        (
            "participant,block,nasa-tlx.effort\nP01,1,105\n",
            "expected 0 to 100 for 'nasa-tlx.effort' in row 1, found 105",
        ),
        ("participant,block,nasa-tlx.efort\nP01,1,5\n", "frustration, found nasa-tlx.efort"),
        ("participant,block,nasa-tlx.raw_tlx\nP01,1,5\n", "frustration, found nasa-tlx.raw_tlx"),  # computed from items
        ("participant,block,fluent\nP01,1,\xff\n", "found invalid UTF-8 (byte 31)"),
        (
            "participant,block,fluent\nP01,1,%s\n" % ("3" * 140_000),
            "found no CSV (field larger than field limit (131072))",
        ),
    ],
)
def test_ratings_that_would_be_misread_are_refused_in_one_line(tmp_path, text, message):
    plan = make_plan(ROBOTS, "custom", SHORT, 1, 1, 0, questionnaires=(read_questionnaire("nasa-tlx"),))
    path = tmp_path / "ratings.csv"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(FileFormatError) as error:
        read_ratings(path, plan)
    assert str(error.value).startswith(f"{path}: expected ")
    assert str(error.value).endswith(message)


def test_the_last_answer_in_a_session_counts_also_when_the_clock_was_set_back(tmp_path):
    plan = make_plan(ROBOTS, "custom", SHORT, 1, 1, 0)
    first = Answer(plan.plan_id, "P01", 1, "own", "one", 4.0, 1.0, "human", time="2024-05-01T10:00:05.000+00:00")
    changed = replace(first, value=6.0, time="2024-05-01T10:00:02.000+00:00")
    later = replace(first, item="two", value=2.0, time="2024-05-02T09:00:00.000+00:00")
    for name, answers in (("P01-01", (first, changed, replace(first, item="two"))), ("P01-02", (later,))):
        (tmp_path / name).mkdir()
        for answer in answers:
            AnswerFile(tmp_path / name).add(answer)
    (row,) = study_ratings([tmp_path], plan, [], None, "human")
    assert (row["own.one"], row["own.two"]) == (6.0, 2.0)


@pytest.mark.parametrize(("dx", "dy"), [(100.0, 100.0), (300.0, -300.0), (113.0, 113.0), (100.0, 0.0), (100.0, 37.0)])
def test_a_start_in_a_set_up_is_of_that_set_up_also_at_45_degrees(dx, dy):
    studies = get_task("table").studies
    scenario = MapConfig((400.0, 350.0, 0.3), (400.0 + dx, 350.0 + dy))
    for front in studies.fronts:
        assert studies.front(studies.with_front(scenario, front)) == front


class _Robot:
    """What a schedule tells the agent and the policies of a study."""

    name = ""

    def __init__(self):
        self.chosen = []

    def choose(self, robot):
        self.chosen.append(robot)


def test_practice_is_on_other_starts_in_both_set_ups_with_the_robots_in_turn():
    task = get_task("table")
    starts = front_configurations(task.scenario_set("unseen"), 24, task.studies.fronts)
    plan = make_plan(ROBOTS, "unseen", starts, 2, 4, 0, task.studies.fronts)
    robot: Any = _Robot()
    schedule = StudySchedule(plan, "P02", robot, robot)
    practised = [schedule.practice(number) for number in range(4)]
    own = {trial.configuration for trial in plan.trials_of("P02")}
    assert not {starts.index(scenario) for scenario in practised} & own
    assert [task.studies.front(scenario) for scenario in practised] == [*task.studies.fronts] * 2
    assert robot.chosen == list(plan.blocks_of("P02").values()) * 2
    assert robot.name == f"study:{plan.plan_id}:P02:practice"
    assert json.loads(schedule.planned)["front"] == "robot_front"
    counts = EpisodeCounts()
    scenario, seats = schedule.next(counts)
    first = plan.trials_of("P02")[0]
    assert (scenario, seats) == (starts[first.configuration], 0)
    assert json.loads(schedule.planned) == {
        "plan": plan.plan_id, "participant": "P02", "trial": first.code, "block": 1, "front": first.front
    }  # fmt: skip
    # Where every start is the person's own, practice is on these.
    alone = make_plan(ROBOTS, "unseen", starts, 1, 24, 0, task.studies.fronts)
    assert StudySchedule(alone, "P01", robot, robot).practice(0) in starts


def test_undo_and_redo_leave_one_recording_of_each_trial(tmp_path):
    plan = make_plan(ROBOTS, "custom", SHORT, 1, 2, 0)
    codes = [trial.code for trial in plan.trials_of("P01")]
    robot: Any = _Robot()
    players = (PlayerSpec("scripted", "S01"), PlayerSpec("scripted", "S02"))
    with prepared(settings(tmp_path, players=players, headless=True, window=None)) as application:
        game = application.game
        game.schedule = StudySchedule(plan, "P01", robot, robot)

        def play() -> str:
            trial = game.next_trial()
            trial.begin({})
            while not trial.outcome.done:
                trial.step(game.ticker.tick())
            return json.loads(trial.planned)["trial"]

        assert play() == codes[0]
        game.close_trial("keep")
        assert play() == codes[1]
        game.close_trial("redo")
        game.undo()  # of the first trial, before the second is repeated
        assert play() == codes[0]
        game.close_trial("keep")
        assert play() == codes[1]
        # An undo of the first trial now, with the second kept after it, would leave two of the second and none of it.
        assert "undo" not in [value for _, value in ResultPhase(game).top.items]
        game.close_trial("keep")
        assert play() == codes[2]
        game.close_trial("keep")
        assert game.kept == 3


def test_only_the_chosen_robot_plans():
    class One:
        name, task, n_action_steps, fps, keeps_history = "one", "table", 8, 10, False

        def __init__(self, value, frames):
            self.value, self.n_obs_steps = value, frames

        def reset(self, seed):
            self.value += seed

        def predict_action_chunk(self, observations):
            return np.full((1, 10, 4), self.value)

    one, other = One(1.0, 2), One(2.0, 3)
    blind = BlindPolicy({"one": one, "other": other}, 1)
    assert (blind.name, blind.n_action_steps, blind.n_obs_steps) == ("study", 1, 2)
    blind.choose("other")
    blind.reset(5)
    assert blind.n_obs_steps == 3
    assert blind.predict_action_chunk({})[0, 0, 0] == 7.0
    assert one.value == 1.0


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A plan of two robots, a person and two short starts, with checkpoints that differ in their weights."""
    folder = tmp_path_factory.mktemp("study")
    robots = untrained_robots(folder)
    plan = make_plan(robots, "custom", SHORT, 1, 2, 0, settings={"num_inference_steps": 2})
    replace_json(folder / "plan.json", plan.to_json())
    return folder


def _summarise(capsys, *flags) -> Any:
    status = main(["human", "summarise", *map(str, flags), "--json"])
    captured = capsys.readouterr()
    return json.loads(captured.out) if status == 0 else (status, captured.err.strip())


def test_a_session_is_blind_in_the_plans_order_and_goes_on_where_it_was_left(study, tmp_path, capsys):
    plan = StudyPlan.read(study / "plan.json")
    out = tmp_path / "recordings"
    flags = ["--participant", "P01", "--out", str(out), "--human", "scripted:S02", "--headless", "--json"]
    flags += ["--practice", "1", "--countdown", "0", "--inference", "thread"]
    assert main(["human", "run", str(study / "plan.json"), *flags]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["complete"] is True
    assert (told["kept"], told["episodes"], told["plan"]) == (5, 4, plan.plan_id)
    found = sorted(out.rglob("*.mcap"))
    episodes = [read_episode(path) for path in found]
    codes = [f"study:{plan.plan_id}:P01:{code}" for code in ("practice", *(t.code for t in plan.trials_of("P01")))]
    assert [episode.meta.controller_0 for episode in episodes] == codes
    assert {episode.meta.controller_1 for episode in episodes} == {"scripted:S02"}
    assert {episode.meta.source for episode in episodes} == {"simulated"}
    assert [e.map_config for e in episodes[1:]] == [plan.configurations[t.configuration] for t in plan.trials_of("P01")]
    assert {episode.physics.step_limit for episode in episodes} == {2000}
    # Nothing in a recording tells the robot; the plan does.
    for name in ("first", "second"):
        digest = next(robot.weights_sha256 for robot in plan.robots if robot.name == name)
        assert not any(digest[:8].encode() in path.read_bytes() for path in found)

    summary = _summarise(capsys, out, "--plan", study / "plan.json", "--out", tmp_path / "result.json")
    assert summary["label"].startswith("SIMULATED")
    assert (summary["episodes"], summary["planned"]) == (4, 4)
    assert summary["left_out"] == {"practice, discarded or interrupted": 1}
    assert {name: robot["episodes"] for name, robot in summary["robots"].items()} == {"first": 2, "second": 2}
    assert summary["robots"]["first"]["success"]["mean"] == 1.0
    assert summary["robots"]["first"]["planning_ms"]["mean"] is not None
    assert summary["tests"]["time_s"]["anova"] is None  # one person
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert (result["study"], len(result["rows"])) == ("human", 4)
    assert [row["robot"] for row in result["rows"]] == [trial.robot for trial in plan.trials_of("P01")]
    assert all(row["interaction_mean"] > 0 for row in result["rows"])
    named = _summarise(capsys, out)
    assert sorted(named["robots"]) == sorted(codes[1:])

    # The last recording is taken away: the session is not finished, and plays that trial again.
    found[-1].unlink()
    assert main(["human", "run", str(study / "plan.json"), *flags]) == 0
    capsys.readouterr()
    kept = [one for one in iter_recordings(out) if one.counts]
    assert read_episode(kept[-1].path).meta.controller_0 == codes[-1]
    assert len(kept) == 4

    # A finished session is not begun again by mistake: its trials would be recorded twice.
    assert main(["human", "run", str(study / "plan.json"), *flags]) == 1
    assert capsys.readouterr().err.splitlines()[-1] == (
        f"copolicy-eval: {out / 'P01-01'}: expected a session of P01 with episodes to play, or --new-session, found "
        "all 4 episodes kept"
    )
    assert sorted(folder.name for folder in out.iterdir() if folder.is_dir()) == ["P01-01"]


def test_a_recording_that_contradicts_the_plan_is_refused(study, tmp_path, capsys):
    simulate(tmp_path, 1, 0, workers=1)
    status, error = _summarise(capsys, tmp_path, "--plan", study / "plan.json")
    assert status == 1
    assert error == (
        f"copolicy-eval: {tmp_path}: expected kept recordings of the study, found none (left out: "
        "{'not of this plan': 1})"
    )
    assert _summarise(capsys, tmp_path / "none")[1].endswith(
        "none: expected a folder of recordings, found no such file or folder"
    )
    status, error = _summarise(capsys, tmp_path, "--ratings", tmp_path / "r.csv")
    assert error == "copolicy-eval: --ratings: expected --plan too, which names the robot of each block, found 'none'"


def test_other_weights_than_the_plans_are_refused(study, tmp_path):
    path = tmp_path / "policy"
    save_untrained_policy(path)
    robot = Robot("first", str(path), "0" * 64)
    plan = make_plan((robot, ROBOTS[1]), "custom", SHORT, 1, 1, 0)
    with pytest.raises(FileFormatError, match=f"{path}: expected the plan's weights {'0' * 12}, found weights "):
        run_session(plan, "P01", PlayerSpec("scripted", "S01"), tmp_path / "out", headless=True)
    assert not (tmp_path / "out").exists()


def test_other_processors_than_the_plans_are_refused(study, tmp_path):
    path = tmp_path / "policy"
    save_untrained_policy(path)
    plan = make_plan((Robot.from_checkpoint("first", str(path)), ROBOTS[1]), "custom", SHORT, 1, 1, 0)
    assert len(plan.to_json()["robots"][0]["processors_sha256"]) == 64
    require_planned_weights(replace(plan, robots=plan.robots[:1]))
    changed = path / "policy_preprocessor.json"
    changed.write_text(changed.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    with pytest.raises(
        FileFormatError, match=f"{path}: expected the plan's processors [0-9a-f]{{12}} .* found processors"
    ):
        run_session(plan, "P01", PlayerSpec("scripted", "S01"), tmp_path / "out", headless=True)
    assert not (tmp_path / "out").exists()


def test_the_plan_command_deals_sixty_starts_among_five_people(study, tmp_path, capsys):
    flags = [f"A={study / 'first'}", f"B={study / 'second'}", "--out", str(tmp_path / "plan.json"), "--json"]
    assert main(["human", "plan", *flags]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["participants"] == ["P01", "P02", "P03", "P04", "P05"]
    assert told["episodes_per_participant"] == 24
    assert told["counterbalanced"] == "4 orders of robots and set-ups: complete only with a multiple of 4 participants"
    plan = StudyPlan.read(tmp_path / "plan.json")
    assert Counter(t.configuration for trials in plan.trials.values() for t in trials) == dict.fromkeys(range(60), 2)
    assert main(["human", "plan", *flags]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert main(["human", "plan", str(study / "first"), "--out", str(tmp_path / "b.json")]) == 2
    assert capsys.readouterr().err.startswith("copolicy-eval: NAME=CKPT: expected a name for each robot, found '")
    assert main(["human", "plan", flags[0], "--out", str(tmp_path / "b.json")]) == 2
    assert capsys.readouterr().err == (
        "copolicy-eval: CKPT: expected at least two robots of different names, found ['A']\n"
    )


def test_the_plan_is_no_abbreviation_of_another_flag_of_run(study, tmp_path, capsys):
    """`human summarise` and `table human` have `--plan`; `run` took it for its `--planner`."""
    with pytest.raises(SystemExit):
        main(["human", "run", "--plan", str(study / "plan.json"), "--participant", "P01", "--out", str(tmp_path)])
    assert capsys.readouterr().err.endswith("run: error: unrecognized arguments: --plan\n")


def test_wrong_calls_of_run_are_one_line(study, tmp_path, capsys):
    plan = str(study / "plan.json")
    assert main(["human", "run", plan, "--participant", "P09", "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == "copolicy-eval: unknown participant 'P09'; available: P01\n"
    flags = ["--participant", "P01", "--out", str(tmp_path), "--human", "replay:x"]
    assert main(["human", "run", plan, *flags]) == 2
    assert capsys.readouterr().err == (
        "copolicy-eval: --human: expected joystick, keyboard or scripted[:PAIR], found 'replay:x'\n"
    )
