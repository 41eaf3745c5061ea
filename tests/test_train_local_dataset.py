"""A damaged or missing data set is named before LeRobot looks for it on the Hub; discarded episodes are left out."""

import shutil
from pathlib import Path

import pytest

from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, RunError
from copolicy.train.local_dataset import check_local_dataset, training_episodes


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
            "{root}/meta/info.json: expected LeRobot's data set information, found no JSON",
        ),
        (
            lambda root: (root / "meta" / "info.json").write_text(
                '{"codebase_version": "v2.1", "total_frames": 1, "total_episodes": 1}', encoding="utf-8"
            ),
            "{root}/meta/info.json: expected codebase_version v3.x, found v2.1, an older one",
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
