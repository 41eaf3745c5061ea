"""Marks a file or folder as one that a living process works on, on every system."""

import os
from pathlib import Path
from typing import BinaryIO

from filelock import lock_descriptor, unlock_descriptor

from ..exceptions import RunError


def lock(file: BinaryIO, wait: bool = False) -> bool:
    """Takes the lock of an open file; the system lets go of it when the file is closed or its process ends, however.

    Other processes may read a locked file, on Windows all but its first byte: the lock only tells a living process
    apart from what a crash left behind.

    Args:
        file: open for writing, which a network file system asks for.
        wait: until another process lets go.

    Returns:
        False where another process holds it. True where it was taken, and where the file system knows no locks (some
        network folders), so that nothing can be told.
    """
    try:
        return lock_descriptor(file.fileno(), blocking=wait)
    except OSError:
        return True


def let_others_read(file: BinaryIO) -> None:
    """Gives a lock back on Windows, where it keeps this process, too, from reading the file by another handle."""
    if os.name == "nt":
        unlock_descriptor(file.fileno())


class FolderLock:
    """Held by a lock file while a tool works in a folder; the system lets go when the process ends, however it ends."""

    def __init__(self, path: Path, refusal: str):
        """Makes the folder where it is missing.

        Args:
            path: of the lock file in it.
            refusal: what to say where another process holds the lock; names the folder.

        Raises:
            RunError: another process holds it.
            OSError: the folder cannot be made or written to.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("ab")
        if not lock(self._file):
            self._file.close()
            raise RunError(refusal)

    def close(self) -> None:
        """Lets go."""
        self._file.close()

    def __enter__(self) -> "FolderLock":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
