"""What a data set needs to be used at all: each thing missing is an error of `check`."""

import json
import math
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, FRAMES, make_data_set, make_recordings, set_columns, set_frames

from copolicy.dataset.checks.checking import check_data, check_dataset, read_data


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return make_recordings(tmp_path_factory.mktemp("recordings"), episodes=3)


@pytest.fixture
def root(recordings, tmp_path):
    return make_data_set(recordings, tmp_path / "table")


def errors(root) -> list[str]:
    result = check_dataset(root)
    assert result.failed() == bool(result.count("error"))
    return [str(finding) for finding in result.findings if finding.severity == "error"]


def change_table(path, change) -> None:
    table = pq.ParquetFile(path).read()
    pq.write_table(change(table), path)


def empty_entry(name, row):
    def change(table):
        values = table.column(name).to_pylist()
        values[row] = None
        place = table.column_names.index(name)
        return table.set_column(place, name, pa.array(values, table.schema.field(name).type))

    return change


def set_info(root, **entries) -> None:
    path = root / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_bytes()), **entries}), encoding="utf-8")


@pytest.mark.parametrize("name", ["action", "observation.state", "next.reward", "timestamp", "index"])
def test_one_empty_value_is_an_error_that_names_the_episode(root, name):
    change_table(root / FRAMES, empty_entry(name, 0))
    assert any(f"column {name} of the frames" in line and "in episode 0" in line for line in errors(root))


@pytest.mark.parametrize("name", ["episode_index", "index", "timestamp", "frame_index", "task_index"])
def test_a_missing_column_of_lerobot_is_an_error(root, name):
    change_table(root / FRAMES, lambda table: table.drop_columns([name]))
    assert any(f"no column {name} in the data files" in line for line in errors(root))


def test_a_rule_that_could_not_be_applied_is_an_error(root):
    table = read_data(root)
    frames = {name: values for name, values in table.frames.items() if name != "timestamp"}
    result = check_data(replace(table, frames=frames))
    assert result.failed()
    assert "error: applied: rules that could not be applied: timestamps needs timestamp" in str(result.findings[0])


@pytest.mark.parametrize("name", ["next.reward", "observation.human_action", "observation.environment_state"])
def test_a_nan_in_any_number_of_the_frames_is_an_error(root, name):
    set_frames(root, name, lambda values: np.where(np.arange(len(values)).reshape(-1, *[1] * (values.ndim - 1)) == 1,
                                                   np.nan, values))  # fmt: skip
    assert any(f"frames whose {name} is not finite" in line for line in errors(root))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda root: set_columns(root, **{"data/file_index": [7, 7, 7]}), "file-007.parquet, which is missing"),
        (lambda root: set_columns(root, **{"data/chunk_index": [0, -1, 0]}), "data/chunk_index -1"),
        (lambda root: set_info(root, data_path=None), "data_path None in meta/info.json"),
        (lambda root: set_info(root, data_path="data/{nothing}.parquet"), "data_path"),
        (lambda root: set_info(root, data_path="../{chunk_index}{file_index}.parquet"), "leads out of the data set"),
        (
            lambda root: change_table(root / EPISODES, lambda table: table.drop_columns(["dataset_from_index"])),
            "no column dataset_from_index",
        ),
        (
            lambda root: change_table(root / EPISODES, empty_entry("dataset_to_index", 1)),
            "episode column dataset_to_index",
        ),
    ],
)
def test_metadata_that_point_to_no_file_are_errors(root, change, message):
    change(root)
    assert any(message in line for line in errors(root)), errors(root)


def test_no_tasks(root):
    (root / "meta/tasks.parquet").unlink()
    assert any(line.startswith("error: tasks: ") and "tasks.parquet" in line for line in errors(root))


def test_a_task_that_is_not_there(root):
    set_frames(root, "task_index", lambda values: values + 1)
    assert any("frames name task 1" in line for line in errors(root))


def test_sentences_that_are_no_index_are_not_found_by_lerobot(root):
    path = root / "meta/tasks.parquet"
    pq.write_table(pq.read_table(path).replace_schema_metadata(None), path)
    assert any("does not have its sentences as the pandas index" in line for line in errors(root))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), "no such file"),
        (lambda path: path.write_text("{", encoding="utf-8"), "invalid JSON"),
        (lambda path: path.write_text("{}", encoding="utf-8"), "has no statistics of"),
        (lambda path: _set_statistic(path, "mean", [math.nan] * 4), "no usable mean of action"),
        (lambda path: _set_statistic(path, "std", [1.0]), "no usable std of action"),
        (lambda path: _set_statistic(path, "max", [9.0] * 4), "the max of action in meta/stats.json differs from"),
    ],
)
def test_no_broken_or_foreign_statistics(root, change, message):
    change(root / "meta/stats.json")
    assert any(line.startswith("error: frame_statistics: ") and message in line for line in errors(root))


def test_statistics_that_are_a_little_off_are_a_warning(root):
    _set_statistic(root / "meta/stats.json", "count", [3])
    found = [finding for finding in check_dataset(root).findings if finding.rule == "frame_statistics"]
    assert [(finding.severity, finding.figure) for finding in found] == [("warning", 3)]


def _set_statistic(path, kind, value) -> None:
    stored = json.loads(path.read_bytes())
    stored["action"][kind] = value
    path.write_text(json.dumps(stored), encoding="utf-8")


def test_a_sound_data_set_has_no_error(root):
    assert errors(root) == []
