"""Writes the numbered files of a LeRobot v3 data set one after the other."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any


class NumberedFiles(AbstractContextManager):
    """Counts through `chunk-000/file-000`, ...; a subclass opens and fills the files."""

    def __init__(self, root: Path, pattern: str, file_mb: float, chunks_size: int):
        self._root, self._pattern = root, pattern
        self._limit, self._chunks_size = file_mb * 2**20, chunks_size
        self._chunk = self._file = 0
        self._writer: Any = None  # of the open file

    def __exit__(self, *_: object) -> None:
        self._close()

    def _new_path(self) -> Path:
        """Path of the current file; creates its folder."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        return self._path

    @property
    def _path(self) -> Path:
        return self._root / self._pattern.format(chunk_index=self._chunk, file_index=self._file)

    def _next(self) -> None:
        """Closes the current file and advances to the next number."""
        self._close()
        from lerobot.datasets.utils import update_chunk_file_indices

        self._chunk, self._file = update_chunk_file_indices(self._chunk, self._file, self._chunks_size)

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
