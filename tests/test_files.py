import os

from copolicy.dataset.files import visible_files


def test_links_are_entered_and_hidden_names_passed_over(tmp_path):
    session, elsewhere = tmp_path / "session", tmp_path / "elsewhere"
    for path in (
        session / "a.mcap",
        session / "._a.mcap",
        session / ".trash" / "b.mcap",
        elsewhere / "deep" / "c.mcap",
    ):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    os.symlink(elsewhere, session / "linked")
    os.symlink(session, elsewhere / "back")  # a circle
    assert visible_files(session, "*.mcap") == [session / "a.mcap", session / "linked" / "deep" / "c.mcap"]


def test_a_folder_linked_twice_counts_once(tmp_path):
    (tmp_path / "session" / "one").mkdir(parents=True)
    (tmp_path / "session" / "one" / "a.mcap").touch()
    os.symlink(tmp_path / "session" / "one", tmp_path / "session" / "two")
    assert visible_files(tmp_path / "session", "*.mcap") == [tmp_path / "session" / "one" / "a.mcap"]
