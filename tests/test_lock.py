"""The lock of a file, tested from this process and from another."""

import subprocess
import sys

import pytest

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.files.lock import FolderLock, lock

HOLDER = """
import sys, time
from copolicy.dataset.files.lock import lock
file = open(sys.argv[1], "ab")
print(lock(file), flush=True)
time.sleep(60)
"""


def test_a_lock_is_released_when_its_process_ends(tmp_path):
    path = tmp_path / "lock"
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "True\n"
        with path.open("ab") as file:
            assert not lock(file)
        process.kill()
    with path.open("ab") as file:
        assert lock(file)


def test_a_locked_file_keeps_its_bytes(tmp_path):
    path = tmp_path / "episode.mcap.part"
    path.write_bytes(b"recorded")
    with path.open("r+b") as first, path.open("r+b") as second:
        assert lock(first, wait=True)
        assert not lock(second)
    assert path.read_bytes() == b"recorded"


def test_a_locked_folder_is_refused_with_the_given_message(tmp_path):
    place = tmp_path / "new" / "lock"
    with FolderLock(place, "in use"), pytest.raises(RunError, match=r"^in use$"):
        FolderLock(place, "in use")
    FolderLock(place, "in use").close()
