import errno
import json

import pytest
from disk_order import inodes, record_disk_order

from copolicy.dataset.exceptions import OutputExistsError
from copolicy.dataset.files.staging import named_errors, new_file, new_folder, replace_json, replacement, require_new


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def build_and_fail(path, error):
    with new_folder(path) as partial:
        partial.mkdir()
        (partial / "file").write_text("half", encoding="utf-8")
        raise error


def build_beside_another(path):
    with new_folder(path) as partial:
        partial.mkdir()
        path.mkdir()


def test_the_folder_appears_when_it_is_complete(tmp_path):
    with new_folder(tmp_path / "deep" / "set") as partial:
        partial.mkdir()
        (partial / "file").write_text("done", encoding="utf-8")
        assert not (tmp_path / "deep" / "set").exists()
    assert names(tmp_path / "deep") == ["set"]
    assert (tmp_path / "deep" / "set" / "file").read_text(encoding="utf-8") == "done"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_nothing(tmp_path, error):
    with pytest.raises(error):
        build_and_fail(tmp_path / "set", error)
    assert names(tmp_path) == []


@pytest.mark.parametrize("place", range(2))
def test_a_broken_link_is_not_overwritten(tmp_path, place):
    paths = [tmp_path / "first", tmp_path / "second"]
    require_new(*paths)
    paths[place].symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputExistsError, match=paths[place].name):
        require_new(*paths)
    require_new(*paths, overwrite=True)


def test_an_existing_path_is_not_overwritten(tmp_path):
    (tmp_path / "set").mkdir()
    with pytest.raises(OutputExistsError) as error, new_folder(tmp_path / "set"):
        pytest.fail("not reached")
    expected = f"{tmp_path / 'set'}: expected a path that does not exist yet, found one; nothing was overwritten"
    assert str(error.value) == expected


def test_a_path_created_during_the_block_is_not_overwritten(tmp_path):
    with pytest.raises(OutputExistsError):
        build_beside_another(tmp_path / "set")
    assert names(tmp_path) == ["set"]


def test_a_broken_link_counts_as_an_existing_path(tmp_path):
    (tmp_path / "set").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputExistsError), new_folder(tmp_path / "set"):
        pytest.fail("not reached")


def test_leftovers_under_a_fixed_suffix_are_deleted(tmp_path):
    (tmp_path / ".set.merging").mkdir()
    (tmp_path / ".set.merging" / "half").write_text("", encoding="utf-8")
    with new_folder(tmp_path / "set", "merging") as partial:
        partial.mkdir()
        assert names(tmp_path) == [".set.merging"]
    assert names(tmp_path) == ["set"]
    assert names(tmp_path / "set") == []


def test_a_folder_is_synced_before_it_is_renamed(tmp_path, monkeypatch):
    order = record_disk_order(monkeypatch)
    with new_folder(tmp_path / "set") as partial:
        (partial / "data").mkdir(parents=True)
        (partial / "data" / "file").write_text("x", encoding="utf-8")
        (partial / "info").write_text("y", encoding="utf-8")
    place = order.index(tmp_path / "set")
    assert set(order[:place]) == inodes(tmp_path / "set", *(tmp_path / "set").rglob("*"))
    assert set(order[place + 1 :]) == inodes(tmp_path)


def test_a_file_is_synced_before_it_is_renamed(tmp_path, monkeypatch):
    order = record_disk_order(monkeypatch)
    with new_file(tmp_path / "one") as partial:
        partial.write_text("x", encoding="utf-8")
    assert order == [*inodes(tmp_path / "one"), tmp_path / "one", *inodes(tmp_path)]


class FixedNameError(OSError):
    """Like PyAV's errors, with a read-only file name."""

    filename = property(lambda self: self.name)  # pyright: ignore[reportAssignmentType]

    def __init__(self, name: str):
        super().__init__(errno.ENOSPC, "No space left on device")
        self.name = name


def test_an_error_with_a_read_only_file_name_is_replaced(tmp_path):
    with (
        pytest.raises(OSError, match=r"No space left on device") as caught,
        replacement(tmp_path / "film.mp4") as partial,
    ):
        raise FixedNameError(str(partial))
    assert caught.value.filename == str(tmp_path / "film.mp4")


def test_an_error_of_a_network_library_keeps_its_message(tmp_path):
    class RemoteError(OSError):
        pass

    with pytest.raises(RemoteError) as caught, named_errors(tmp_path / "run"):
        raise RemoteError("404 Client Error")
    assert (caught.value.errno, caught.value.filename) == (None, None)


def test_a_document_that_cannot_be_written_leaves_the_old_file(tmp_path):
    path = tmp_path / "statistics.json"
    replace_json(path, {"a": 1}, allow_nan=False)
    with pytest.raises(ValueError, match="nan"):
        replace_json(path, {"a": float("nan")}, allow_nan=False)
    assert json.loads(path.read_text(encoding="utf-8")) == {"a": 1}
    assert list(tmp_path.iterdir()) == [path]
