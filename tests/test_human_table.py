"""The paper's tables from recordings: its own study from reconstructed successes, and a whole walk with a stand-in."""

import csv
import json
import multiprocessing
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from own_questionnaire import OWN
from untrained_policy import untrained_robots

from copolicy.collect.questionnaire import Questionnaire, answers_in
from copolicy.collect.session import iter_recordings
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.recording.reader import read_recording
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.human_study.design import make_plan
from copolicy.evaluate.human_study.plan import Robot, StudyPlan
from copolicy.evaluate.human_table.tables import human_table
from copolicy.evaluate.human_table.text import csv_text, markdown
from copolicy.tasks.table.map_config import MapConfig

TRIALS = Path(__file__).parent / "data" / "robot_study" / "trials.csv"
NAMES = {"BC": "BC-LSTM-GMM"}
STUDIES = get_task("table").studies
STARTS = tuple(
    STUDIES.with_front(MapConfig((803.0, y, 3.14), (960.0, y)), front)
    for y in (250.0, 350.0)
    for front in STUDIES.fronts
)
"""Straight ahead, about a second away, with either end in front."""


def _robot_study():
    with TRIALS.open(encoding="utf-8", newline="") as file:
        trials = list(csv.DictReader(file))
    rows = [
        {
            "participant": trial["participant"], "robot": NAMES.get(trial["method"], trial["method"]),
            "front": trial["configuration"].replace(" ", "_"), "success": trial["success"] == "true",
            "source": "human", "map_id": "one", "time_s": 12.0 + k % 3, "wall_time_s": 30.0 + k % 3,
            "interaction_mean": 0.1, "interaction_p95": 0.3, "planning_ms": 90.0,
        }
        for k, trial in enumerate(trials)
    ]  # fmt: skip
    robots = [Robot(name, "", "") for name in dict.fromkeys(row["robot"] for row in rows)]
    return rows, make_plan(robots, "custom", STARTS, 6, 4, 0, STUDIES.fronts)


@pytest.fixture(scope="module")
def papers() -> dict[str, Any]:
    """The table of the paper's robot study."""
    rows, plan = _robot_study()
    return human_table(rows, [], plan, {"practice, discarded or interrupted": 2})


def test_the_papers_third_table_with_its_tests_and_without_its_slip(papers):
    table = papers
    assert (len(table["robots"]), len(table["fronts"])) == (5, 10)
    effects = {effect["source"]: effect for effect in table["tests"]["fronts"]["success"]["anova"]}
    assert effects["robot x front"]["F"] == pytest.approx(3.170, abs=5e-4)
    assert effects["front"]["F"] == pytest.approx(7.857, abs=5e-4)
    assert effects["robot"]["F"] == pytest.approx(3.152, abs=5e-4)
    for row in table["fronts"]:
        paper, success = row["published"], row["success"]
        assert paper["method"] == row["robot"]
        assert success["mean"] == pytest.approx(paper["success"])
        assert success["sd"] == pytest.approx(paper["sd"], abs=1e-5)
        assert paper["printed_sd"] == pytest.approx(success["sd"] / 6, abs=1e-5)  # not a deviation, nor its error
        assert success["standard_error"] == pytest.approx(success["sd"] / 6**0.5)
    text = markdown(table)
    assert "| CoDP-H | human front | 6 | 12 | 75.0 | 27.4 | 11.2 |" in text
    assert "| 75.0 | 27.4 (4.6) | 11.2 |" in text
    assert "F(4, 20) = 3.17" in text
    assert "- practice, discarded or interrupted 2" in text
    assert "Unit of analysis: the participant;" in text
    assert "people at the human seat" in text
    assert "BC-LSTM-GMM: human_front - robot_front -0.667" in text


def test_the_second_table_has_both_times_beside_the_published_wall_time(papers):
    row = papers["robots"][0]
    assert row["robot"] == "CoDP-H"
    assert row["time_s"]["mean"] < 15 < row["wall_time_s"]["mean"]
    assert row["planning_ms"]["mean"] == 90.0
    assert row["published"] == {"method": "CoDP-H", "success": 0.68, "wall_time_s": 32.3, "planning_ms": 93.5}
    lines = list(csv.DictReader(csv_text(papers).splitlines()))
    assert {line["label"] for line in lines} == {"human"}
    wall = next(line for line in lines if (line["robot"], line["measure"]) == ("CoDP-H", "wall_time_s"))
    assert (float(wall["published"]), wall["participants"]) == (32.3, "6")


def test_questionnaires_are_scored_and_their_consistency_stated():
    rows, plan = _robot_study()
    rows = [row for row in rows if row["participant"] in ("S1", "S2")]
    form = Questionnaire.from_json(
        json.dumps(OWN | {"scores": [{"name": "sum", "title": "both", "items": ["one", "two"]}]}), "own"
    )
    asked = StudyPlan(**{**vars(plan), "questionnaires": (form,)})
    ratings = [
        {"participant": person, "robot": robot.name, "own.one": k + p, "own.two": k + p, "own.sum": k + p, "free": k}
        for p, person in enumerate(("S1", "S2", "S3"))
        for k, robot in enumerate(plan.robots)
    ]
    table = human_table(rows, ratings, asked, {})
    by_key = {row["question"]: row for row in table["questionnaires"]}
    assert list(by_key) == ["own.sum", "own.one", "own.two", "free"]
    assert by_key["own.sum"]["alpha"] == pytest.approx(1.0)  # the two items agree
    assert by_key["own.sum"]["robots"]["CoDP-H"]["mean"] == pytest.approx(1.0)
    assert by_key["free"]["kind"] == "file"
    assert by_key["own.one"]["test"]["test"] == "Friedman"
    text = markdown(table)
    assert "| both (0 to 10) |" in text
    assert "| one" not in text.lower()  # items of a questionnaire with scores are in the CSV and the JSON


def test_items_of_a_questionnaire_without_scores_are_shown_beside_one_with_scores():
    rows, plan = _robot_study()
    scored = OWN | {"name": "scored", "scores": [{"name": "sum", "title": "both", "items": ["one", "two"]}]}
    forms = tuple(Questionnaire.from_json(json.dumps(content), "own") for content in (scored, OWN))
    asked = StudyPlan(**{**vars(plan), "questionnaires": forms})
    ratings = [
        {"participant": person, "robot": robot.name}
        | {f"{form}.{name}": k for form in ("scored", "own") for name in ("one", "two")}
        | {"scored.sum": k}
        for person in ("S1", "S2")
        for k, robot in enumerate(plan.robots)
    ]
    text = markdown(human_table(rows, ratings, asked, {}))
    assert [text.count(f"| {title} (0 to 10) |") for title in ("both", "One?", "Two?")] == [1, 1, 1]


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A plan of two robots, one person, both set-ups and a questionnaire of a lab's own."""
    folder = tmp_path_factory.mktemp("study")
    robots = untrained_robots(folder)
    form = Questionnaire.from_json(json.dumps(OWN), "own")
    plan = make_plan(
        robots, "custom", STARTS, 1, 2, 0, STUDIES.fronts, settings={"num_inference_steps": 2}, questionnaires=(form,)
    )
    replace_json(folder / "plan.json", plan.to_json())
    return folder


def _kill_the_planner_after_the_first_recording(out: Path) -> threading.Thread:
    def work() -> None:
        limit = time.monotonic() + 120
        while time.monotonic() < limit and not (out.is_dir() and [r for r in iter_recordings(out) if r.counts]):
            time.sleep(0.05)
        for child in multiprocessing.active_children():
            os.kill(child.pid or 0, signal.SIGKILL)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_the_whole_walk_with_a_planner_that_dies_on_the_way(study, tmp_path, capsys):
    plan, out = StudyPlan.read(study / "plan.json"), tmp_path / "recordings"
    assert plan.robots[0].method == "CoDP-H"  # known from its configuration
    run = ["human", "run", str(study / "plan.json"), "--participant", "P01", "--out", str(out), "--headless", "--json"]
    run += ["--human", "scripted:S02", "--practice", "0", "--countdown", "0"]
    killer = _kill_the_planner_after_the_first_recording(out)
    assert main(run) == 1
    killer.join(10)
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert error == (
        "copolicy-eval: inference: expected a running process, found that it ended (killed, or out of memory); run the "
        "same command to continue"
    )
    assert main([*run, "--inference", "thread"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["complete"], told["kept_in_session"], told["episodes"]) == (True, 4, 4)

    kept = [read_recording(recording.path) for recording in iter_recordings(out) if recording.counts]
    for recording, trial in zip(kept, plan.trials_of("P01"), strict=True):
        events = {event.kind: event.detail for event in recording.events}
        assert json.loads(events["planned"]) == {
            "plan": plan.plan_id, "participant": "P01", "trial": trial.code, "block": trial.block, "front": trial.front
        }  # fmt: skip
        assert STUDIES.front(recording.episode.map_config) == trial.front
        assert "mean" in events["plans"]
        assert events["duration"].startswith("simulated ")
        assert not any(robot.name in detail for robot in plan.robots for detail in events.values())
    answers = [answer for _, answer in answers_in(out)]
    assert [(answer.block, answer.item) for answer in answers] == [(1, "one"), (1, "two"), (2, "one"), (2, "two")]
    assert {answer.source for answer in answers} == {"simulated"}

    # Without the answers to the last block the session is not over: they are asked for again, in the same session.
    (path,) = out.rglob("answers.jsonl")
    path.write_text("".join(path.read_text(encoding="utf-8").splitlines(keepends=True)[:3]), encoding="utf-8")
    assert main([*run, "--inference", "thread"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["complete"], told["kept"], told["kept_in_session"]) == (True, 0, 4)
    assert [(one.block, one.item) for _, one in answers_in(out)] == [(a.block, a.item) for a in answers]
    assert [folder.name for folder in out.iterdir() if folder.is_dir()] == ["P01-01"]

    tables = tmp_path / "tables"
    call = ["table", "human", "--recordings", str(out), "--plan", str(study / "plan.json"), "--out", str(tables)]
    assert main([*call, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["label"].startswith("SIMULATED")
    table = json.loads((tables / "table.json").read_text(encoding="utf-8"))
    assert {(row["robot"], row["front"]) for row in table["fronts"]} == {
        (robot.name, front) for robot in plan.robots for front in STUDIES.fronts
    }
    for row in table["robots"]:
        assert row["planning_ms"]["mean"] > 0
        assert row["wall_time_s"]["mean"] == pytest.approx(row["time_s"]["mean"], abs=0.5)
    assert [row["question"] for row in table["questionnaires"]] == ["own.one", "own.two"]
    assert "no person took part" in (tables / "table.md").read_text(encoding="utf-8")
    assert "no person took part" in (tables / "table.csv").read_text(encoding="utf-8")

    assert main(["human", "summarise", str(out), "--plan", str(study / "plan.json")]) == 0
    told = capsys.readouterr().out
    assert "success_by_front" in told
    assert "human_front" in told

    # A CSV completes the answers, and must not contradict them.
    block = answers[0].block
    ratings = tmp_path / "ratings.csv"
    ratings.write_text(f"participant,block,comment_score\nP01,{block},3\n", encoding="utf-8")
    assert main([*call, "--ratings", str(ratings), "--json"]) == 0
    capsys.readouterr()
    table = json.loads((tables / "table.json").read_text(encoding="utf-8"))
    assert [row["question"] for row in table["questionnaires"]] == ["own.one", "own.two", "comment_score"]
    ratings.write_text(f"participant,block,own.one\nP01,{block},{answers[0].value + 1}\n", encoding="utf-8")
    assert main([*call, "--ratings", str(ratings)]) == 2
    assert capsys.readouterr().err == (
        f"copolicy-eval: {ratings}: expected own.one {answers[0].value:g} of P01 block {block}, as answered then, "
        f"found {answers[0].value + 1:g}\n"
    )


def test_wrong_calls_are_one_line(study, tmp_path, capsys):
    call = ["table", "human", "--recordings", str(tmp_path), "--plan", str(study / "plan.json"), "--out"]
    assert main([*call, str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith(f"copolicy-eval: {tmp_path}: expected a folder of recordings, found ")
    assert not (tmp_path / "out").exists()
    (tmp_path / "file").touch()
    assert main([*call, str(tmp_path / "file")]) == 2
    assert capsys.readouterr().err.startswith(f"copolicy-eval: {tmp_path / 'file'}: expected a folder for the tables")
    (tmp_path / "table.md").write_text("mine", encoding="utf-8")
    assert main([*call, str(tmp_path)]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    plan = ["human", "plan", f"A={study / 'first'}", f"B={study / 'second'}", "--out", str(tmp_path / "plan.json")]
    assert main([*plan, "--questionnaires", "tlx"]) == 2
    assert capsys.readouterr().err == (
        "copolicy-eval: unknown questionnaire 'tlx'; available: FILE.json, fluency, nasa-tlx\n"
    )
    assert main([*plan, "--starts", "orientations", "--questionnaires", "none", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["set_ups"], told["questionnaires"]) == ([], [])
