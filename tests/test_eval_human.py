"""The study with people: a session with a simulated player at the human seat, and the commands."""

import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from human_plan import ROBOTS, SHORT
from play_session import settings
from untrained_policy import save_untrained_policy, untrained_robots

from copolicy.collect.play.result import ResultPhase
from copolicy.collect.play.session_run import prepared
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.session import EpisodeCounts, iter_recordings
from copolicy.collect.simulate.command import simulate
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.human_study.design import make_plan
from copolicy.evaluate.human_study.plan import Robot, StudyPlan
from copolicy.evaluate.human_study.schedule import BlindPolicy, StudySchedule
from copolicy.evaluate.human_study.session import require_planned_weights, run_session
from copolicy.evaluate.partner_study.configurations import front_configurations


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
