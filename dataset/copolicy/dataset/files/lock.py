"""Locks a file or folder while a process works on it, on every operating system."""

import os
from pathlib import Path
from typing import BinaryIO

from filelock import lock_descriptor, unlock_descriptor

from ..exceptions import RunError


def lock(file: BinaryIO, wait: bool = False) -> bool:
    """Locks an open file; the system releases the lock when the file is closed or the process ends or crashes.

    Other processes may still read the file (on Windows all but its first byte): the lock only shows that its process
    is alive, which tells a running recording from an unfinished one.

    Args:
        file: open for writing, which network file systems require.
        wait: wait until another process releases the lock.

    Returns:
        False if another process has the lock. True if the lock was taken, and also where the file system does not
        support locks (some network folders).
    """
    try:
        return lock_descriptor(file.fileno(), blocking=wait)
    except OSError:
        return True


def unlock_on_windows(file: BinaryIO) -> None:
    """Releases a lock on Windows, where it also stops this process from reading the file by another handle."""
    if os.name == "nt":
        unlock_descriptor(file.fileno())


class FolderLock:
    """A lock file in a folder, locked while a command works there; released when the process ends or crashes."""

    def __init__(self, path: Path, locked_message: str):
        """Creates the folder if it does not exist and takes the lock.

        Args:
            path: the lock file.
            locked_message: message of the error if another process has the lock; names the folder.

        Raises:
            RunError: another process has the lock.
            OSError: the folder cannot be created or written to.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("ab")
        if not lock(self._file):
            self._file.close()
            raise RunError(locked_message)

    def close(self) -> None:
        """Releases the lock."""
        self._file.close()

    def __enter__(self) -> "FolderLock":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
