"""A damaged or missing data set is named before LeRobot looks for it on the Hub; discarded episodes are left out."""

import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.train.episode_choice import check_local_dataset, training_episodes


@pytest.mark.parametrize(
    ("episodes", "discarded", "expected"),
    [
        (None, [], None),
        (None, [False] * 4, None),
        (None, [False, True, False, False], [0, 2, 3]),
        ([3, 1], [False, True, False, False], [3]),
        ([3, 2], [False, True, False, False], [3, 2]),
    ],
)
def test_episodes_to_train_on(episodes, discarded, expected):
    assert training_episodes(episodes, 4, discarded) == expected


def test_episodes_that_are_not_there_or_all_discarded():
    with pytest.raises(InvalidValueError, match=r"^dataset.episodes: expected 0 to 3, found 9$"):
        training_episodes([1, 9], 4, [])
    with pytest.raises(RunError, match=r"^dataset.episodes: all of the 2 episodes to train on are marked"):
        training_episodes([0, 1], 4, [True, True, False, False])


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (shutil.rmtree, "{root}: expected the folder of a LeRobot v3 data set, found no such folder"),
        (
            lambda root: (root / "meta" / "info.json").unlink(),
            "{root}: expected a LeRobot v3 data set with meta/info.json, found a folder of other files",
        ),
        (
            lambda root: (root / "meta" / "info.json").write_text("{", encoding="utf-8"),
            "{root}/meta/info.json: expected LeRobot's data set information, found invalid JSON",
        ),
        (
            lambda root: (root / "meta" / "info.json").write_text(
                '{"codebase_version": "v2.1", "total_frames": 1, "total_episodes": 1}', encoding="utf-8"
            ),
            "{root}/meta/info.json: expected codebase_version v3.x, found v2.1; LeRobot converts this older version",
        ),
        (
            lambda root: truncate(root / "data" / "chunk-000" / "file-000.parquet"),
            "{root}/data/chunk-000/file-000.parquet: expected a complete Parquet file, found Parquet magic bytes not",
        ),
        (
            lambda root: (root / "data" / "chunk-000" / "file-000.parquet").unlink(),
            "{root}/data: expected 75 rows, as meta/info.json says, found 0",
        ),
        (
            lambda root: shutil.rmtree(root / "meta" / "episodes"),
            "{root}: expected a LeRobot data set with episodes under meta/episodes, found none",
        ),
        (
            lambda root: (root / "meta" / "tasks.parquet").unlink(),
            "{root}: expected a LeRobot v3 data set with meta/tasks.parquet, found none",
        ),
    ],
)
def test_a_damaged_data_set_is_named_and_not_looked_for_on_the_hub(copied_table, damage, message):
    check_local_dataset(copied_table)
    damage(copied_table)
    with pytest.raises(FileFormatError) as caught:
        check_local_dataset(copied_table)
    assert str(caught.value).startswith(message.format(root=copied_table))


def frames(root: Path, name: str, change) -> None:
    path = root / "data" / "chunk-000" / "file-000.parquet"
    table = pq.ParquetFile(path).read()
    values = pa.array([change(value) for value in table.column(name).to_pylist()])
    pq.write_table(table.set_column(table.column_names.index(name), name, values), path)


@pytest.mark.parametrize(
    ("name", "change", "expected", "found"),
    [
        ("observation.human_action", str, "2 numbers of type float32", "string"),
        ("action", lambda value: [*value, 0.0], "4 numbers of type float32", "5 numbers in a row"),
        ("action", lambda value: [value], "4 numbers of type float32", "list<"),
        ("observation.state", lambda value: value[0], None, "double"),
        ("next.reward", lambda value: {"value": 1.0}, "a number of type float32", "struct<"),
        ("next.reward", lambda value: None, "a number of type float32", "null"),
        ("task_index", lambda value: value + 0.5, "a number of type int64", "fractions"),
    ],
)
def test_a_column_that_lerobot_cannot_cast_is_named(copied_table, name, change, expected, found):
    frames(copied_table, name, change)
    path = copied_table / "data" / "chunk-000" / "file-000.parquet"
    with pytest.raises(FileFormatError) as caught:
        check_local_dataset(copied_table)
    message = str(caught.value)
    assert message.startswith(f"{path}: expected ")
    assert expected is None or f"{expected} in every row of {name}" in message
    assert f"found {found}" in message


def test_whole_numbers_stored_as_others_and_empty_values_are_left_to_lerobot(copied_table):
    frames(copied_table, "frame_index", float)
    frames(copied_table, "observation.human_action", lambda value: None if value[0] > 0.9 else value)
    check_local_dataset(copied_table)


@pytest.mark.parametrize(
    ("column", "change", "found"),
    [
        ("dataset_from_index", lambda values: [value + 2**62 for value in values], "dataset_from_index 4611686018427"),
        ("dataset_to_index", lambda values: [value - 1 for value in values], "dataset_to_index"),
        ("dataset_from_index", lambda values: [0] * len(values), "dataset_from_index 0 and"),
    ],
)
def test_episodes_whose_frames_are_others_are_named(copied_table, column, change, found):
    for path in (copied_table / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        values = pa.array(change(table.column(column).to_pylist()))
        pq.write_table(table.set_column(table.column_names.index(column), column, values), path)
    with pytest.raises(FileFormatError, match="expected consecutive episodes") as caught:
        check_local_dataset(copied_table)
    assert found in str(caught.value)


def test_statistics_of_episodes_that_are_no_lists_are_named(copied_table):
    for path in (copied_table / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        name = "stats/episode_index/mean"
        values = pa.array([0.5] * table.num_rows)
        pq.write_table(table.set_column(table.column_names.index(name), name, values), path)
    with pytest.raises(FileFormatError, match="stats/episode_index/mean of meta/episodes: expected a list of numbers"):
        check_local_dataset(copied_table)
