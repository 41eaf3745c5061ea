"""Writes HDF5 files so that a full disk raises an error instead of a crash.

The HDF5 library flushes its buffers when a file is closed. If a write fails then, the library fails again for every
open object and ends in a segmentation fault. So it writes through a Python file object that stores the first error,
lets the library close the file, and raises the error afterwards.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py


class DeferredErrorFile(io.FileIO):
    """The file object that an HDF5 file writes to; stores the first write error in `error` instead of raising it."""

    def __init__(self, path: Path):
        self.error: OSError | None = None
        super().__init__(path, "w+b")

    def check(self) -> None:
        """
        Raises:
            OSError: a write has failed.
        """
        if self.error is not None:
            raise self.error

    def write(self, data) -> int:
        view = memoryview(data).cast("B")
        if self.error is None:
            try:
                written = 0
                while written < len(view):
                    written += super().write(view[written:]) or 0
            except OSError as error:
                self.error = error
        return len(view)

    def readinto(self, buffer) -> int:
        view = memoryview(buffer).cast("B")
        read = super().readinto(view) or 0
        view[read:] = bytes(len(view) - read)  # bytes that could not be written
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        size = self.tell() if size is None else size
        if self.error is None:
            try:
                super().truncate(size)
            except OSError as error:
                self.error = error
        return size


@contextmanager
def new_hdf5(path: Path, **options) -> Iterator[tuple[h5py.File, DeferredErrorFile]]:
    """Opens a new HDF5 file; also yields its file object, whose `check` raises a write error early.

    Args:
        options: of `h5py.File`.

    Raises:
        OSError: a write failed.
    """
    with DeferredErrorFile(path) as storage:
        with h5py.File(storage, "w", **options) as file:
            yield file, storage
        storage.check()
