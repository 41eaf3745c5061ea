"""Sets of scenarios of any task, and the task without files of them."""

from dataclasses import dataclass

import pytest

from copolicy.dataset.exceptions import InvalidValueError, UnknownNameError
from copolicy.dataset.scenarios import ScenarioName, ScenarioSet, is_file_name, set_label
from copolicy.dataset.task import PairTask, get_task


@dataclass(frozen=True)
class Mark:
    place: int

    @property
    def digest(self) -> str:
        return f"{self.place:08x}"

    def to_json(self) -> str:
        return f"[{self.place}]"


class PegTask(PairTask):
    """What a set asks of a task."""

    spec = get_task().spec
    scenario_sets = {"near": (Mark(1), Mark(2))}  # noqa: RUF012  # type: ignore[assignment]
    scenario_of_json = scenario_vector = scenario_of_vector = make_world = None  # type: ignore[assignment]


MARKS = ScenarioSet("peg", "lab", "3", (Mark(1), Mark(2), Mark(3)), (1, 2, 1), {"test": (2, 0)}, from_file=True)


def test_weights_and_splits():
    assert [mark.place for mark in MARKS.scheduled] == [1, 2, 2, 3]
    test = MARKS.for_split("test")
    assert [mark.place for mark in test.scenarios] == [3, 1]
    assert (test.label, test.digest, test.describe()["from"]) == ("lab#test", MARKS.digest, "file")
    with pytest.raises(UnknownNameError, match="unknown split of lab 'train'; available: test"):
        MARKS.for_split("train")
    with pytest.raises(UnknownNameError, match="available: none"):
        test.for_split("test")


def test_the_digest_sees_scenarios_weights_and_splits_and_no_name():
    def of(scenarios=MARKS.scenarios, weights=MARKS.weights, splits=MARKS.splits, name="lab"):
        return ScenarioSet("peg", name, "4", scenarios, weights, splits).digest

    assert of() == of(name="other") == MARKS.digest
    assert len({of(), of(MARKS.scenarios[::-1]), of(weights=(1, 1, 1)), of(splits={})}) == 4


def test_a_task_without_files_says_so():
    task = PegTask()
    assert task.scenario_set("near").scenarios == (Mark(1), Mark(2))
    assert task.name_of(Mark(2)) == ScenarioName("near-01", "near")
    with pytest.raises(InvalidValueError, match="has no scenario files"):
        task.scenario_set("lab.yaml")
    with pytest.raises(UnknownNameError, match="unknown map set 'far'; available: near"):
        task.scenario_set("far")
    with pytest.raises(InvalidValueError, match="has no start orientations"):
        task.turned(task.scenario_set("near"))


@pytest.mark.parametrize(
    ("text", "expected"),
    [("lab.yaml", True), ("lab.YML#test", True), ("maps/lab", True), ("unseen", False), ("un#seen", False)],
)
def test_what_names_a_file(text, expected):
    assert is_file_name(text) == expected


def test_the_set_of_an_episode():
    row = {"map_set": "lab", "map_set_version": "3", "map_set_digest": "ab"}
    assert set_label(row) == "lab (version 3, ab)"
    assert set_label({**row, "map_set_digest": ""}) == "lab"
