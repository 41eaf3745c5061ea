import os

import pytest

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.listing import (
    broken_links,
    distinct_files,
    skipping_hidden_files,
    visible_files,
    without_duplicates,
)


@pytest.fixture
def session(tmp_path):
    """A folder with recordings, hidden and foreign files, and a linked folder from which a link leads back."""
    session, elsewhere = tmp_path / "session", tmp_path / "elsewhere"
    for path in (
        session / "a.mcap",
        session / "._a.mcap",
        session / ".trash" / "b.mcap",
        session / "__MACOSX" / "a.mcap",
        session / "notes.txt",
        elsewhere / "deep" / "c.mcap",
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    os.symlink(elsewhere, session / "linked")
    os.symlink(session, elsewhere / "back")  # a circle
    os.symlink("..", session / "up")
    return session


@pytest.mark.parametrize("files", [visible_files, distinct_files])
def test_links_are_followed_and_hidden_files_skipped(session, files):
    assert files(session, "*.mcap") == [session / "a.mcap", session / "linked" / "deep" / "c.mcap"]
    assert files(session, "*.mcap", "*.txt")[-1] == session / "notes.txt"


def test_a_linked_folder_can_be_listed(session, tmp_path):
    os.symlink(session, tmp_path / "name")
    assert visible_files(tmp_path / "name", "a.mcap") == [tmp_path / "name" / "a.mcap"]
    assert distinct_files(tmp_path / "name", "a.mcap") == [tmp_path / "name" / "a.mcap"]


def test_a_missing_folder_is_empty(tmp_path):
    assert visible_files(tmp_path / "none", "*") == distinct_files(tmp_path / "none", "*") == []


def test_a_file_is_listed_once_by_its_own_path(tmp_path):
    (tmp_path / "session" / "one").mkdir(parents=True)
    recording = tmp_path / "session" / "one" / "a.mcap"
    recording.touch()
    os.symlink(recording.parent, tmp_path / "session" / "all")
    os.symlink(recording, tmp_path / "session" / "a.mcap")
    os.link(recording, tmp_path / "session" / "one" / "b.mcap")
    assert distinct_files(tmp_path / "session", "*.mcap") == [recording]
    assert len(visible_files(tmp_path / "session", "*.mcap")) == 5
    assert without_duplicates([recording, tmp_path / "session" / "a.mcap"]) == [recording]


def test_circular_links_terminate(tmp_path):
    folders = [tmp_path / f"session-{number:02d}" for number in range(12)]
    for folder in folders:
        folder.mkdir()
        (folder / "a.mcap").touch()
        for other in folders:
            os.symlink(other, folder / other.name)
    assert distinct_files(tmp_path, "*.mcap") == [folder / "a.mcap" for folder in folders]


def test_broken_links_are_listed(session):
    os.symlink("gone.mcap", session / "lost.mcap")
    os.symlink("/nowhere/session-2", session / "session-2")
    os.symlink("ring", session / "ring")
    assert session / "lost.mcap" in visible_files(session, "*.mcap")
    assert session / "lost.mcap" in distinct_files(session, "*.mcap")
    assert broken_links(session) == [session / "lost.mcap", session / "ring", session / "session-2"]


def test_an_unreadable_folder_is_an_error(session, monkeypatch):
    scandir = os.scandir

    def refused(path):
        if str(path).endswith("deep"):
            raise PermissionError(13, "Permission denied")
        return scandir(path)

    monkeypatch.setattr(os, "scandir", refused)
    expected = "linked/deep: expected a folder that can be read, found Permission denied"
    for files in (visible_files, distinct_files):
        with pytest.raises(FileFormatError, match=expected):
            files(session, "*.mcap")


def test_wrapped_functions_skip_hidden_files(session):
    names = skipping_hidden_files(lambda folder: sorted(path.name for path in folder.glob("*.mcap")))
    assert names(session) == ["a.mcap"]
