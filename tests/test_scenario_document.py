"""YAML and JSON that people write: what differs from a type, at its place."""

import json

import msgspec
import pytest

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.scenario_document import Document


class Point(msgspec.Struct):
    x: float
    y: float = 0.0


class Drawing(msgspec.Struct):
    name: str
    points: list[Point] = []


def document(tmp_path, text, name="file.yaml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return Document(path)


def said(tmp_path, text, name="file.yaml"):
    value, problems = document(tmp_path, text, name).typed(Drawing)
    assert (value is None) == bool(problems)
    return [str(problem) for problem in problems]


@pytest.mark.parametrize("name", ["file.yaml", "file.yml", "file.json"])
def test_a_sound_file(tmp_path, name):
    content = {"name": "a", "points": [{"x": 1, "y": 2.5}, {"x": 0}]}
    value, problems = document(tmp_path, json.dumps(content), name).typed(Drawing)
    assert value == Drawing("a", [Point(1.0, 2.5), Point(0.0)])
    assert not problems


def test_everything_that_differs_is_named_with_its_place_and_line(tmp_path):
    text = "nam: a\npoints:\n  - {x: left, z: 1}\n  - 3\n  - {y: .nan, x: 1}\n"
    assert said(tmp_path, text) == [
        "nam (line 1): unknown key; did you mean name?",
        "no name",
        "points[0].z (line 3): unknown key; known are x, y",
        "points[0].x (line 3): expected a number, found 'left'",
        "points[1] (line 4): expected a mapping, found a whole number",
        "points[2].y (line 5): expected a number, found nan",
    ]
    assert said(tmp_path, json.dumps({"name": 3, "points": 4}), "a.json") == [
        "name: expected text, found 3", "points: expected a list, found 4",
    ]  # fmt: skip


def test_a_key_that_is_there_twice(tmp_path):
    assert said(tmp_path, "name: a\nname: b\n") == ["name (line 2): duplicate key"]
    with pytest.raises(FileFormatError, match="duplicate key 'name' in one mapping"):
        document(tmp_path, '{"name": "a", "name": "b"}', "a.json")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("a: &b [1]\nc: *b\n", "an alias (*name), which is not read in line 2"),
        ("a: [1\n", "expected ',' or ']', but got '<stream end>' in line 2"),
        ("a: !!python/object/apply:os.system [echo]\n", "could not determine a constructor for the tag"),
        ("", "an empty file"),
        ("- 1\n", "found a list"),
    ],
)
def test_what_is_not_read(tmp_path, text, found):
    with pytest.raises(FileFormatError) as error:
        document(tmp_path, text).typed(Drawing)
    assert found in str(error.value)
    assert "\n" not in str(error.value)


def test_a_date_is_a_text(tmp_path):
    assert said(tmp_path, "name: 2026-01-01\n") == []


def test_no_file(tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        Document(tmp_path / "file.yaml")
    with pytest.raises(FileFormatError, match="folder"):
        Document(tmp_path)
