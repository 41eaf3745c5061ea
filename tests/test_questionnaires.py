"""Questionnaires as data, and the file of answers."""

import json
from dataclasses import replace

import pytest
from own_questionnaire import OWN

from copolicy.collect.questionnaire import FORMS, Answer, AnswerFile, Questionnaire, answers_in, read_questionnaire
from copolicy.dataset.exceptions import CopolicyError, FileFormatError


@pytest.mark.parametrize("name", FORMS)
def test_a_form_of_the_package_is_complete_and_the_same_after_writing(name):
    form = read_questionnaire(name)
    assert Questionnaire.from_json(json.dumps(form.to_json()), name) == form
    assert form.name == name
    scored = [item for score in form.scores for item in score.items]
    assert sorted(scored) == sorted(item.name for item in form.items), "each item is in one score"
    assert "not compared with" in form.source  # the wording is our own, and it says so


def test_the_workload_has_six_scales_in_steps_of_five():
    form = read_questionnaire("nasa-tlx")
    scale = form.scale
    assert (len(form.items), scale.marks, scale.value(3), scale.mark(85.0), scale.mark(83.0)) == (6, 21, 15.0, 17, None)
    answers = {item.name: 10.0 * number for number, item in enumerate(form.items)}
    assert form.score(form.scores[0], answers) == pytest.approx(25.0)
    assert form.score(form.scores[0], {**answers, "effort": None}) is None


def test_reversed_statements_are_mirrored():
    form = read_questionnaire("fluency")
    contribution = next(score for score in form.scores if score.name == "contribution")
    best = {"carried_the_team": 1.0, "partner_contributed_equally": 7.0, "i_mattered_most": 1.0}
    assert form.score(contribution, {**best, "partner_mattered_most": 7.0}) == 7.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"scale": {**OWN["scale"], "step": 3}}, "expected a scale of whole steps, at most 101 marks, found Scale("),
        ({"scale": {**OWN["scale"], "high": 0}}, "expected a scale with low < high and step > 0, found Scale("),
        ({"scale": {**OWN["scale"], "high": float("inf")}}, "expected a scale of finite numbers, found Scale("),
        ({"scale": {**OWN["scale"], "step": 0}}, "expected a scale of finite numbers, found Scale("),
        ({"scale": {**OWN["scale"], "step": 1e-320}}, "expected a scale of finite numbers, found Scale("),
        ({"scale": {**OWN["scale"], "step": -2}}, "expected a scale with low < high and step > 0, found Scale("),
        ({"items": []}, "expected at least one item, found none"),
        (
            {"items": [{"name": "one", "text": "word " * 50}]},
            "expected at most 240 characters in the text of one, found 250",
        ),
        (
            {"instruction": "word " * 61},
            "expected at most 300 characters in the instruction of the questionnaire, found 305",
        ),
        (
            {"items": [{"name": "one", "text": "One?", "labels": ["no", "y" * 41]}]},
            "expected at most 40 characters in the label of one, found 41",
        ),
        ({"items": OWN["items"][:1] * 2}, "expected items and scores of different names, found one"),
        ({"items": [{"name": "One", "text": "?"}]}, "expected names of a-z, 0-9, '_' and '-' that begin with a letter"),
        ({"items": [{"name": "one", "text": " "}]}, "expected a text for one, found  "),
        ({"scores": [{"name": "s", "title": "s", "items": ["three"]}]}, "expected items of the questionnaire in score"),
        ({"title": 3}, "expected a questionnaire, with str at $.title, found int"),
    ],
)
def test_a_wrong_file_is_named_with_its_part(tmp_path, change, message):
    path = tmp_path / "own.json"
    path.write_text(json.dumps(OWN | change), encoding="utf-8")
    with pytest.raises(FileFormatError) as error:
        read_questionnaire(path)
    assert str(error.value).startswith(f"{path}: {message}")


def test_a_file_of_a_lab_and_unknown_names(tmp_path):
    path = tmp_path / "own.json"
    path.write_text(json.dumps(OWN), encoding="utf-8")
    form = read_questionnaire(path)
    assert [item.labels for item in form.items] == [("no", "yes"), ("a", "b")]
    with pytest.raises(CopolicyError, match=r"unknown questionnaire 'tlx'; available: FILE.json, fluency, nasa-tlx"):
        read_questionnaire("tlx")
    with pytest.raises(FileFormatError, match="expected a questionnaire, found no such file"):
        read_questionnaire(tmp_path / "none.json")


ANSWER = Answer("abcd", "P01", 1, "own", "one", 4.0, 1.5, "human")


def test_the_newest_answer_counts_and_a_line_cut_short_is_asked_again(tmp_path):
    file = AnswerFile(tmp_path)
    assert not file.path.exists()
    file.add(ANSWER)
    file.add(replace(ANSWER, value=6.0))
    file.add(replace(ANSWER, item="two", value=8.0))
    whole = file.path.read_bytes()
    file.path.write_bytes(whole[:-9])  # as a crash in the middle of a write leaves it
    again = AnswerFile(tmp_path)
    assert again.values(1, "own") == {"one": 6.0}
    assert again.values(2, "own") == {}
    again.add(replace(ANSWER, item="two", value=2.0))
    lines = again.path.read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["value"] for line in lines] == [4.0, 6.0, 2.0]
    assert [answer.value for _, answer in answers_in(tmp_path)] == [4.0, 6.0, 2.0]


def test_a_damaged_line_is_named(tmp_path):
    AnswerFile(tmp_path).add(ANSWER)
    path = tmp_path / "answers.jsonl"
    path.write_text(path.read_text(encoding="utf-8") + '{"study": 1}\n', encoding="utf-8")
    with pytest.raises(FileFormatError, match="expected an answer in line 2, found none: "):
        AnswerFile(tmp_path)


def test_a_full_disk_leaves_no_part_of_an_answer(tmp_path, monkeypatch):
    file = AnswerFile(tmp_path)
    file.add(ANSWER)
    before = file.path.read_bytes()

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        file.add(replace(ANSWER, value=8.0))
    assert file.path.read_bytes() == before
    assert file.values(1, "own") == {"one": 4.0}
