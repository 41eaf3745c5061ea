"""`copolicy-convert mcap --append`: as if all recordings had been converted together, with the old files untouched."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from checked_data import contents, make_data_set, make_recordings
from disk_order import inodes, record_disk_order
from loaded_sets import assert_same_frames, assert_same_statistics, load

from copolicy.convert.cli import main
from copolicy.convert.lerobot import append
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.lerobot_folder.exclusions import exclude, excluded_episodes


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Two sessions, the first as a data set, and both as another."""
    folder = tmp_path_factory.mktemp("append")
    make_recordings(folder / "a", 4, seed=1)
    make_recordings(folder / "b", 3, seed=2)
    make_data_set(folder / "a", folder / "set")
    shutil.copytree(folder / "a", folder / "both" / "a")
    shutil.copytree(folder / "b", folder / "both" / "b")
    make_data_set(folder / "both", folder / "whole")
    return folder


@pytest.fixture
def root(folders, tmp_path) -> Path:
    return Path(shutil.copytree(folders / "set", tmp_path / "set"))


def add(folder: Path, root: Path, *flags: str) -> int:
    arguments = ["mcap", str(folder), "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0"]
    return main([*arguments, "--append", "--json", *flags])


def test_the_result_is_that_of_one_conversion(folders, root, capsys):
    before = contents(root)
    assert add(folders / "both", root) == 0
    summary = json.loads(capsys.readouterr().out)
    appended, together = load(root), load(folders / "whole")
    assert (summary["already_there"], summary["episodes_added"]) == (4, 3)
    assert (summary["episodes"], summary["frames"]) == (7, together.num_frames) == (7, appended.num_frames)
    rows, expected = appended.meta.episodes, together.meta.episodes
    assert rows.column_names == expected.column_names
    for name in rows.column_names:
        if name.endswith(("file_index", "chunk_index")):
            continue
        for value, expected_value in zip(rows[name], expected[name], strict=True):
            np.testing.assert_equal(value, expected_value, err_msg=name)
    assert_same_frames(appended, together, every=11)
    assert_same_statistics(appended, together)
    assert appended.meta.info.splits == {"train": "0:7"}
    after = contents(root)
    changed = {name for name in before if after[name] != before[name]}
    assert changed == {"meta/info.json", "meta/stats.json", "meta/copolicy.json"}
    assert set(after) - set(before) == {
        "data/chunk-000/file-001.parquet", "meta/episodes/chunk-000/file-001.parquet",
    }  # fmt: skip
    assert [finding for finding in check_dataset(root).findings if finding.severity == "error"] == []
    assert list(root.parent.iterdir()) == [root]


def test_exclusions_stay_and_nothing_is_added_twice(folders, root, capsys):
    exclude(root, ["1"], "stick unplugged")
    assert add(folders / "b", root) == 0
    after = contents(root)
    capsys.readouterr()
    assert add(folders / "both", root) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["already_there"], summary["episodes_added"]) == (7, 0)
    assert contents(root) == after
    exclude(root, ["6"], "withdrawn")
    assert [(entry.episode, entry.reason) for entry in excluded_episodes(root)] == [
        (1, "stick unplugged"),
        (6, "withdrawn"),
    ]
    record = json.loads((root / "meta" / "copolicy.json").read_text(encoding="utf-8"))
    assert [addition["files"] for addition in record["appended"]] == [3]


def test_a_third_session_goes_into_a_third_file(folders, root, tmp_path):
    make_recordings(tmp_path / "c", 2, seed=3)
    assert add(folders / "b", root) == 0
    assert add(tmp_path / "c", root) == 0
    dataset = load(root)
    assert dataset.num_episodes == 9
    assert dataset.meta.episodes["data/file_index"] == [0] * 4 + [1] * 3 + [2] * 2
    path = root / "meta" / "episodes" / "chunk-000" / "file-002.parquet"
    assert pq.ParquetFile(path).read(["meta/episodes/file_index"]).column(0).to_pylist() == [2, 2]
    assert int(dataset[dataset.num_frames - 1]["episode_index"]) == 8


@pytest.mark.parametrize("renamed", [0, 1])
def test_an_interrupted_append_is_restored(folders, root, monkeypatch, renamed):
    before = contents(root)
    rename = Path.rename
    calls = []

    def interrupted(self, target):
        calls.append(self)
        if len(calls) > renamed:
            raise KeyboardInterrupt
        return rename(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", interrupted)
        assert add(folders / "b", root) == 130
    append.finish_interrupted(root)
    assert contents(root) == before
    assert list(root.parent.iterdir()) == [root]
    assert add(folders / "b", root) == 0
    assert load(root).num_episodes == 7


def test_everything_is_on_the_disk_before_the_rename(folders, root, monkeypatch):
    with monkeypatch.context() as patch:
        happened = record_disk_order(patch)
        assert add(folders / "b", root) == 0
    position = happened.index(root)
    assert inodes(root, *root.rglob("*")) <= set(happened[:position])
    assert happened[position + 1 :] == [*inodes(root.parent)]


def test_a_damaged_recording_changes_nothing(folders, root, tmp_path, capsys):
    folder = shutil.copytree(folders / "b", tmp_path / "damaged")
    broken = folder / "episode_000001.mcap"
    broken.write_bytes(broken.read_bytes()[:-2000])
    before = contents(root)
    assert add(folder, root) == 1
    assert str(broken) in capsys.readouterr().err
    assert contents(root) == before
    assert add(folder, root, "--skip-damaged") == 0
    assert load(root).num_episodes == 6


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--fps", "30"], "--fps: expected 10, as {root} has it, found 30"),
        (["--downsampling", "first"], "--downsampling: expected 'mean', as {root} has it, found 'first'"),
    ],
)
def test_another_clock_is_refused(folders, root, capsys, flags, message):
    before = contents(root)
    assert add(folders / "b", root, *flags) == 2
    assert capsys.readouterr().err == f"copolicy-convert: {message.format(root=root)}\n"
    assert contents(root) == before


def test_there_must_be_a_data_set(folders, tmp_path, capsys):
    assert add(folders / "b", tmp_path / "none") == 2
    error = capsys.readouterr().err
    assert error.startswith(
        f"copolicy-convert: {tmp_path / 'none'}: expected a LeRobot v3 data set with meta/info.json"
    )
    assert not os.path.lexists(tmp_path / "none")
