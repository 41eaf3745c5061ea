"""Linked folders and files: followed by every command, counted once, and named if broken."""

import json
import os
import shutil
from pathlib import Path

import pytest
from checked_data import contents, make_data_set, make_recordings
from loaded_sets import load

from copolicy.collect.cli import main as collect
from copolicy.collect.session import SessionFolder, iter_recordings
from copolicy.convert.cli import main as convert
from copolicy.convert.upstream.conversion import open_upstream
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.transfer.raw_recordings import find_raw_recordings
from copolicy.dataset.versions.manifest import Manifest


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> Path:
    """Two sessions, the first of two recordings and the second of one, and the data set of both."""
    folder = tmp_path_factory.mktemp("linked")
    make_recordings(folder / "both" / "a", 2, seed=1)
    make_recordings(folder / "both" / "b", 1, seed=2)
    make_data_set(folder / "both", folder / "whole")
    return folder


@pytest.fixture
def linked(folders, tmp_path) -> Path:
    """The same recordings, the second session behind a link and a second link to one of them."""
    folder = tmp_path / "both"
    shutil.copytree(folders / "both" / "a", folder / "a")
    shutil.copytree(folders / "both" / "b", tmp_path / "disk" / "b")
    os.symlink(tmp_path / "disk" / "b", folder / "b")
    os.symlink(folder / "a" / "episode_000000.mcap", folder / "latest.mcap")
    return folder


def converted(folder: Path, root: Path, *flags: str) -> int:
    arguments = ["mcap", str(folder), "--out", str(root), "--repo-id", "lab/table", "--license", "cc-by-4.0"]
    return convert([*arguments, "--json", *flags])


def without_record(root: Path) -> dict[str, bytes]:
    return {name: data for name, data in contents(root).items() if name != "meta/copolicy.json"}


def test_a_conversion_enters_links(folders, linked, tmp_path):
    assert converted(linked, tmp_path / "set") == 0
    assert contents(tmp_path / "set") == contents(folders / "whole")


def test_a_recording_counts_once_however_it_is_named(folders, linked, tmp_path):
    sources = [str(linked), str(linked / "b"), str(linked / "latest.mcap")]
    arguments = ["--out", str(tmp_path / "set"), "--repo-id", "lab/table", "--license", "cc-by-4.0"]
    assert convert(["mcap", *sources, *arguments]) == 0
    assert contents(tmp_path / "set") == contents(folders / "whole")


def test_shards_and_append_enter_links(folders, linked, tmp_path, capsys):
    assert converted(linked, tmp_path / "set", "--shard-episodes", "2") == 0
    assert load(tmp_path / "set").num_episodes == 3
    make_data_set(folders / "both" / "a", tmp_path / "first")
    capsys.readouterr()
    assert converted(linked, tmp_path / "first", "--append") == 0
    assert (summary := json.loads(capsys.readouterr().out))["episodes_added"] == 1
    assert summary["already_there"] == 2


def test_check_recover_and_raw_recordings_enter_links(folders, linked, tmp_path, capsys):
    result = check_dataset(linked)
    assert result.data.labels == ("a/episode_000000.mcap", "a/episode_000001.mcap", "b/episode_000000.mcap")
    assert result.count("error") == 0
    raw = find_raw_recordings(folders / "whole", linked)
    assert sorted(raw.files) == [f"raw/{label}" for label in result.data.labels]
    assert raw.left_out == []
    broken = tmp_path / "disk" / "b" / "episode_000000.mcap"
    broken.write_bytes(broken.read_bytes()[:-3000])
    broken.rename(f"{broken}.part")
    assert collect(["recover", str(linked), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["recovered"] == 1


def test_a_linked_session_is_counted(tmp_path):
    from test_play_folder import FIXED, _record

    (tmp_path / "disk").mkdir()
    first = SessionFolder(tmp_path / "disk", "P01", FIXED, 1)
    _record(first)
    (tmp_path / "sessions").mkdir()
    os.symlink(first.path, tmp_path / "sessions" / "P01-01")
    assert len(list(iter_recordings(tmp_path / "sessions"))) == 1
    # The linked session is complete: the next one is begun, and nothing is added to it.
    following = SessionFolder(tmp_path / "sessions", "P01", FIXED, 1)
    assert (following.path.name, following.continued) == ("P01-02", False)
    assert following.counts.kept.total() == 1
    assert SessionFolder(tmp_path / "sessions", "P02", FIXED, 1).counts.kept.total() == 1


def test_the_originals_files_are_found_behind_links(examples, tmp_path):
    for name, format in (("raw", "raw"), ("processed_npz", "processed"), ("table_10Hz.zarr", "zarr")):
        folder = tmp_path / format
        folder.mkdir()
        os.symlink(examples / name, folder / name)
        source, expected = open_upstream(folder), open_upstream(examples / name)
        assert (source.format, len(source.readers)) == (format, len(expected.readers))


def test_a_data_set_behind_links_is_read_appended_to_and_released(folders, tmp_path, capsys):
    make_data_set(folders / "both" / "a", tmp_path / "disk" / "set")
    root = tmp_path / "set"
    root.mkdir()
    for path in (tmp_path / "disk" / "set").iterdir():
        os.symlink(os.path.relpath(path, root), root / path.name)
    os.symlink(folders / "both", root / "raw")
    before = contents(tmp_path / "disk")
    assert Manifest.from_folder(root).files == Manifest.from_folder(tmp_path / "disk" / "set").files != {}
    assert check_dataset(root).count("error") == 0
    assert converted(folders / "both", root, "--append") == 0
    assert json.loads(capsys.readouterr().out)["episodes"] == 3
    assert load(root).num_episodes == 3
    assert contents(tmp_path / "disk") == before
    assert os.readlink(root / "raw") == str(folders / "both")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["disk", "set"]


def test_a_recording_whose_link_leads_nowhere_is_named(folders, linked, tmp_path, capsys):
    lost = linked / "a" / "lost.mcap"
    os.symlink("/nowhere/lost.mcap", lost)
    assert converted(linked, tmp_path / "set") == 1
    assert capsys.readouterr().err.startswith(
        f"copolicy-convert: {lost}: expected a readable MCAP file, found No such file or directory; nothing was written"
    )
    assert converted(linked, tmp_path / "set", "--shard-episodes", "2") == 1
    assert str(lost) in capsys.readouterr().err
    assert converted(linked, tmp_path / "other", "--skip-damaged") == 0
    (message,) = json.loads(capsys.readouterr().out)["damaged_left_out"]
    assert message.startswith(str(lost))
    found = [(f.episode, f.message) for f in check_dataset(linked).findings if f.severity == "error"]
    assert found == [("a/lost.mcap", "a link that leads nowhere")]
    with pytest.raises(CopolicyError, match=r"lost\.mcap: expected a recording, found a broken link"):
        find_raw_recordings(folders / "whole", linked)
    capsys.readouterr()
    assert collect(["recover", str(linked), "--damaged", "--json"]) == 1
    summary = json.loads(capsys.readouterr().out)
    assert (summary["damaged"], list(summary["files"])) == (1, ["a/lost.mcap"])


def test_a_broken_link_to_a_session_is_reported(linked, tmp_path, capsys, caplog):
    shutil.rmtree(tmp_path / "disk")
    assert converted(linked, tmp_path / "set") == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["episodes"] == 2
    assert f"warning: {linked / 'b'}: a broken link; its target is skipped" in caplog.text
    found = [(f.episode, f.message) for f in check_dataset(linked).findings if f.severity == "error"]
    assert found == [("b", "a link that leads nowhere")]
    assert len(list(iter_recordings(linked))) == 2
    assert f"not counted: {linked / 'b'}: a broken link" in caplog.text
    (tmp_path / "empty").mkdir()
    os.symlink("/nowhere", tmp_path / "empty" / "session")
    assert dataset(["check", str(tmp_path / "empty")]) == 2
    assert "found a link that leads nowhere, session" in capsys.readouterr().err
    assert converted(tmp_path / "empty" / "session", tmp_path / "other") == 2
    assert "session: expected a folder of recordings, found a broken link" in capsys.readouterr().err


def test_a_file_of_a_data_set_whose_link_leads_nowhere_is_named(folders, tmp_path, capsys):
    root = Path(shutil.copytree(folders / "whole", tmp_path / "set"))
    os.symlink("/nowhere", root / "meta" / "notes.txt")
    with pytest.raises(CopolicyError, match=r"notes\.txt: expected a file, found a broken link"):
        Manifest.from_folder(root)
    before = set(os.listdir(root / "meta"))
    make_recordings(tmp_path / "raw", 1, seed=9)
    assert converted(tmp_path / "raw", root, "--append") == 2
    assert "notes.txt: expected a file of the data set, found a broken link" in capsys.readouterr().err
    assert set(os.listdir(root / "meta")) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["raw", "set"]
