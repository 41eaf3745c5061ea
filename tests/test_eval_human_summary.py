"""The summary of a study with people, with ratings and answers."""

from dataclasses import replace

import numpy as np
import pytest
from human_plan import ROBOTS, SHORT

from copolicy.collect.questionnaire import Answer, AnswerFile, read_questionnaire
from copolicy.dataset.exceptions import FileFormatError
from copolicy.evaluate.human_study.design import make_plan
from copolicy.evaluate.human_study.ratings import read_ratings, study_ratings
from copolicy.evaluate.human_study.summary import summarise_study


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
