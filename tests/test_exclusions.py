"""Excluded episodes are flagged, kept, listed, preserved by LeRobot's tools, and left out of training."""

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from checked_data import EPISODES, contents, make_data_set, make_recordings, set_columns
from lerobot.configs.default import DatasetConfig
from lerobot.configs.train import TrainPipelineConfig
from lerobot.datasets import LeRobotDataset
from lerobot.datasets.dataset_tools import merge_datasets
from lerobot.scripts import lerobot_train

from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.lerobot_folder.exclusions import exclude, excluded_episodes, include
from copolicy.train.memory_training import _datasets_in_memory
from lerobot_policy_copolicy.copolicy.configuration_copolicy import CopolicyConfig

REASON = "joystick of player 1 unplugged"


@pytest.fixture(scope="module")
def converted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exclusions")
    return make_data_set(make_recordings(folder / "recordings", 5), folder / "set")


@pytest.fixture
def root(converted, tmp_path) -> Path:
    return Path(shutil.copytree(converted, tmp_path / "set"))


def table(root: Path) -> Any:
    return pq.ParquetFile(root / EPISODES).read()


def uuids(root: Path) -> list[str]:
    return table(root).column("episode_uuid").to_pylist()


def test_only_the_flag_and_its_reason_change(root):
    before, files = table(root), contents(root)
    set_columns(root, quality_flags=["", "slow_loop", "", "", ""])
    assert exclude(root, ["1", "3-4"], REASON) == {"excluded": [1, 3, 4], "already_discarded": []}
    after = table(root)
    assert after.column("discarded").to_pylist() == [False, True, False, True, True]
    flag = f"excluded: {REASON}"
    assert after.column("quality_flags").to_pylist() == ["", f"slow_loop,{flag}", "", flag, flag]
    assert after.schema.equals(before.schema, check_metadata=True)
    for name in before.column_names:
        if name not in ("discarded", "quality_flags"):
            ours, theirs = after.column(name).to_pylist(), before.column(name).to_pylist()
            assert str(ours) == str(theirs), name  # as text, because nan differs from itself
    now = contents(root)
    assert {name for name in files.keys() | now.keys() if files.get(name) != now.get(name)} == {EPISODES.as_posix()}


def test_a_flag_is_removed(root):
    before = table(root)
    exclude(root, [uuids(root)[2]], "a first reason, with a comma")
    assert excluded_episodes(root) == [(2, uuids(root)[2], "a first reason; with a comma")]
    exclude(root, ["2"], REASON)
    assert [entry.reason for entry in excluded_episodes(root)] == [REASON]
    assert include(root, ["0-4"]) == {"included": [2], "not_excluded": [0, 1, 3, 4]}
    assert str(table(root).to_pylist()) == str(before.to_pylist())
    assert excluded_episodes(root) == []


def test_discarded_episodes_stay_unchanged(root):
    set_columns(root, discarded=[True, False, False, False, False])
    assert exclude(root, ["0", "1"], REASON) == {"excluded": [1], "already_discarded": [0]}
    assert include(root, ["0", "1"]) == {"included": [1], "not_excluded": [0]}
    assert excluded_episodes(root) == [(0, uuids(root)[0], "")]


def test_the_command(root, capsys):
    assert main(["exclude", str(root), "--episode-ids", "0", "2-3", "--reason", REASON, "--json"]) == 0
    expected = {"root": str(root), "excluded": [0, 2, 3], "already_discarded": []}
    assert json.loads(capsys.readouterr().out) == expected
    assert main(["exclude", str(root), "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["left_out"]
    assert listed[0] == {"episode": 0, "episode_uuid": uuids(root)[0], "reason": REASON}
    assert main(["exclude", str(root), "--list"]) == 0
    assert capsys.readouterr().out.splitlines()[1] == f"  episode 0  {REASON}"
    assert main(["exclude", str(root), "--undo", "--episode-ids", "2"]) == 0
    assert [entry.episode for entry in excluded_episodes(root)] == [0, 3]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--episode-ids", "1"), "--reason: expected why the episodes are excluded, found ''"),
        (("--reason", "x"), "--episode-ids: expected numbers, ranges such as 3-5, or episode_uuids, found None"),
        (
            ("--episode-ids", "1", "3-9", "--reason", "x"),
            "--episode-ids: expected numbers from 0 to 4, ranges such as 3-5, or existing episode_uuids, found '3-9'",
        ),
        (("--episode-ids", "1", "--reason", "x", "--undo"), "--reason: expected none with --undo, found 'x'"),
        (("--list", "--reason", "x"), "--list: expected neither --episode-ids nor --reason with it, found 'one'"),
    ],
)
def test_a_wrong_call_changes_nothing(root, capsys, arguments, message):
    before = contents(root)
    assert main(["exclude", str(root), *arguments]) == 2
    assert capsys.readouterr().err == f"copolicy-dataset: {message}\n"
    assert contents(root) == before


@pytest.mark.parametrize("text", ["5-3", "0-99999999999", "-1", "two"])
def test_missing_episodes_are_refused(root, text):
    with pytest.raises(Exception, match="expected numbers from 0 to 4"):
        exclude(root, [text], REASON)


def test_a_folder_without_a_data_set_is_refused(root, tmp_path, capsys):
    assert main(["exclude", str(tmp_path / "none"), "--list"]) == 2
    expected = "expected a LeRobot v3 data set with meta/info.json, found no such file or folder\n"
    assert capsys.readouterr().err == f"copolicy-dataset: {tmp_path / 'none'}: {expected}"
    bare = table(root).drop_columns(["discarded"])
    pq.write_table(bare, root / EPISODES)
    assert main(["exclude", str(root), "--list"]) == 2
    assert capsys.readouterr().err.endswith("expected the episode columns of copolicy, found none named discarded\n")


def test_a_crash_before_the_renaming_leaves_the_old_file(root, monkeypatch):
    before = contents(root)

    def crash(*_):
        raise OSError(errno.EIO, "the power went")

    monkeypatch.setattr(os, "replace", crash)
    with pytest.raises(OSError, match="the power went"):
        exclude(root, ["1"], REASON)
    assert contents(root) == before


def _trained_on(root: Path, episodes: list[int] | None = None) -> tuple[Any, Any]:
    config = TrainPipelineConfig(
        DatasetConfig("lab/table", root=str(root), episodes=episodes),
        policy=CopolicyConfig(device="cpu", push_to_hub=False),
    )
    with _datasets_in_memory():
        dataset, _ = lerobot_train.make_train_eval_datasets(config)
    return dataset, config


def test_training_leaves_excluded_episodes_out(root):
    lengths = table(root).column("length").to_pylist()
    whole, _ = _trained_on(root)
    assert whole.num_frames == sum(lengths)
    exclude(root, ["1", "4"], REASON)
    dataset, config = _trained_on(root)
    assert config.dataset.episodes == [0, 2, 3]
    assert dataset.num_frames == sum(lengths[episode] for episode in (0, 2, 3))
    indices = range(0, len(dataset), 7)
    assert {int(dataset[index]["episode_index"]) for index in indices} == {0, 2, 3}
    include(root, ["4"])
    assert _trained_on(root, [3, 4])[0].num_frames == lengths[3] + lengths[4]


def test_flags_and_every_episode_column_survive_loading_and_merging(root, converted, tmp_path):
    exclude(root, ["2"], REASON)
    recordings = make_recordings(tmp_path / "other_recordings", 3, seed=9)
    other = make_data_set(recordings, tmp_path / "other_lab")
    sets: list[Any] = [LeRobotDataset("lab/table", root=root), LeRobotDataset("other/table", root=other)]
    merge_datasets(sets, "both/table", tmp_path / "merged")
    merged: Any = LeRobotDataset("both/table", root=tmp_path / "merged").meta.episodes
    assert len(merged) == 8
    for name in EPISODE_COLUMNS:
        expected = [*sets[0].meta.episodes[name], *sets[1].meta.episodes[name]]
        found = list(merged[name])
        if EPISODE_COLUMNS[name] == "float":
            # LeRobot merges through pandas, which writes NaN as null.
            found, expected = ([np.nan if value is None else value for value in values] for values in (found, expected))
            assert np.array_equal(found, expected, equal_nan=True), name
        else:
            assert found == expected, name
    assert [(entry.episode, entry.reason) for entry in excluded_episodes(tmp_path / "merged")] == [(2, REASON)]
    result = check_dataset(tmp_path / "merged")
    assert [finding for finding in result.findings if finding.severity == "error"] == []
    exclude(tmp_path / "merged", ["7"], "withdrawn")
    dataset, config = _trained_on(tmp_path / "merged")
    assert config.dataset.episodes == [0, 1, 3, 4, 5, 6]
    assert dataset.num_episodes == 6
