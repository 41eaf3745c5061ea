"""An HDF5 file in the making that a full disk cannot break.

The HDF5 library writes what it keeps in memory when a file is closed. Where the disk refuses, it fails there again and
again, for every object that is open, and ends in a segmentation fault. So it writes through Python, which notes the
refusal, lets the library close the file as if all were well, and raises then.
"""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py


class NotedRefusals(io.FileIO):
    """The file below an HDF5 file; what the disk refuses is kept in `refusal` and not raised."""

    def __init__(self, path: Path):
        self.refusal: OSError | None = None
        super().__init__(path, "w+b")

    def check(self) -> None:
        """
        Raises:
            OSError: the disk refused something so far.
        """
        if self.refusal is not None:
            raise self.refusal

    def write(self, data) -> int:
        view = memoryview(data).cast("B")
        if self.refusal is None:
            try:
                written = 0
                while written < len(view):
                    written += super().write(view[written:]) or 0
            except OSError as error:
                self.refusal = error
        return len(view)

    def readinto(self, buffer) -> int:
        view = memoryview(buffer).cast("B")
        read = super().readinto(view) or 0
        view[read:] = bytes(len(view) - read)  # what was refused
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        size = self.tell() if size is None else size
        if self.refusal is None:
            try:
                super().truncate(size)
            except OSError as error:
                self.refusal = error
        return size


@contextmanager
def new_hdf5(path: Path, **options) -> Iterator[tuple[h5py.File, NotedRefusals]]:
    """A new HDF5 file to write to, and what is below it, to be checked now and then.

    Args:
        options: of `h5py.File`.

    Raises:
        OSError: the disk refused something.
    """
    with NotedRefusals(path) as storage:
        with h5py.File(storage, "w", **options) as file:
            yield file, storage
        storage.check()
