"""Which task a policy of LeRobot's own learned: its data say, else its features, else the table."""

import json
from pathlib import Path

import pytest

from copolicy.collect.agents.training_conditions import TrainingConditions, training_conditions
from copolicy.dataset.exceptions import UnknownNameError
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE, features_of
from copolicy.dataset.task import get_task


def config(folder: Path, columns_of: str | None, **more) -> Path:
    """The configuration of an ACT with the features of a task."""
    columns = features_of(get_task(columns_of).spec) if columns_of else {}
    features = {name: {"shape": list(columns[name]["shape"])} for name in (STATE, ENVIRONMENT_STATE) if columns}
    outputs = {ACTION: {"shape": list(columns[ACTION]["shape"])}} if columns else {}
    image = {"observation.images.scene": {"shape": [3, 64, 96]}}
    content = {"type": "act", "input_features": {**features, **image}, "output_features": outputs, **more}
    (folder / "config.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


def learned(folder: Path) -> tuple[str, str]:
    """The task, and how it is known."""
    conditions = training_conditions(folder)
    assert isinstance(conditions, TrainingConditions)
    assert conditions.settings == get_task(conditions.task).settings_type()
    return conditions.task, conditions.notes[0].partition("; ")[2]


def data_set(folder: Path, robot_type: str) -> Path:
    """As much of a data set as tells its task."""
    (folder / "meta").mkdir(parents=True)
    text = json.dumps({"robot_type": robot_type, "fps": 20})
    (folder / "meta" / "info.json").write_text(text, encoding="utf-8")
    return folder


def test_features_that_one_task_alone_has(peg, tmp_path):
    assert learned(config(tmp_path, "peg")) == ("peg", "'peg' is the only one with its features")
    assert learned(config(tmp_path, "table")) == ("table", "'table' is the only one with its features")
    assert learned(config(tmp_path, None)) == ("table", "'table' is assumed")


@pytest.mark.parametrize("place", ["root", "cache"])
def test_the_data_set_says_it(peg, tmp_path, monkeypatch, place):
    root = data_set(tmp_path / "lab" / "pegs", "copolicy_peg")
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path))
    settings = {"root": str(root)} if place == "root" else {"repo_id": "lab/pegs"}
    (tmp_path / "train_config.json").write_text(json.dumps({"dataset": settings}), encoding="utf-8")
    assert learned(config(tmp_path, "table")) == ("peg", "'peg' is that of its data set")
    assert training_conditions(tmp_path).fps == 20
    # What the checkpoint itself says counts.
    assert training_conditions(config(tmp_path, "table", task="table", fps=10)).task == "table"


def test_data_of_a_task_that_is_not_installed(tmp_path):
    root = data_set(tmp_path / "set", "copolicy_rope")
    (tmp_path / "train_config.json").write_text(json.dumps({"dataset": {"root": str(root)}}), encoding="utf-8")
    with pytest.raises(UnknownNameError, match="unknown task 'rope'"):
        training_conditions(config(tmp_path, "table"))


def test_data_that_name_no_task_leave_it_to_the_features(peg, tmp_path):
    root = data_set(tmp_path / "set", "so100")
    (tmp_path / "train_config.json").write_text(json.dumps({"dataset": {"root": str(root)}}), encoding="utf-8")
    assert learned(config(tmp_path, "peg")) == ("peg", "'peg' is the only one with its features")
