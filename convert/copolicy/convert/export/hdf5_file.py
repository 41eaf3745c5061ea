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


class NotedRefusals(io.RawIOBase):
    """The file below an HDF5 file; what the disk refuses is kept in `refusal` and not raised."""

    def __init__(self, path: Path):
        super().__init__()
        self.refusal: OSError | None = None
        self._file = path.open("w+b", buffering=0)

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
                    written += self._file.write(view[written:]) or 0
            except OSError as error:
                self.refusal = error
        return len(view)

    def readinto(self, buffer) -> int:
        view = memoryview(buffer).cast("B")
        read = self._file.readinto(view) or 0
        view[read:] = bytes(len(view) - read)  # what was refused
        return len(view)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def truncate(self, size: int | None = None) -> int:
        size = self._file.tell() if size is None else size
        if self.refusal is None:
            try:
                self._file.truncate(size)
            except OSError as error:
                self.refusal = error
        return size

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        if not self.closed:
            self._file.close()
        super().close()


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
