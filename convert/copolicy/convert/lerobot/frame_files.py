"""The data files of a LeRobot v3 data set: a row group an episode."""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import MissingExtraError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq

    from lerobot.datasets.feature_utils import get_hf_features_from_features
    from lerobot.datasets.utils import DEFAULT_DATA_PATH, update_chunk_file_indices
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


class FrameFiles:
    """The data files, written one after the other: `data/chunk-000/file-000.parquet`, ..."""

    def __init__(self, root: Path, features: dict[str, dict], file_mb: float, chunks_size: int):
        self._root, self._limit, self._chunks_size = root, file_mb * 2**20, chunks_size
        self._schema = get_hf_features_from_features(features).arrow_schema
        self._chunk = self._file = 0
        self._writer: Any = None

    def __enter__(self) -> "FrameFiles":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def append(self, columns: dict[str, np.ndarray]) -> dict[str, int]:
        """Adds an episode's columns, `(T,)` or `(T, n)`; returns the columns of meta/episodes that say where."""
        if self._writer is not None and self._path.stat().st_size >= self._limit:
            self._close()
            self._chunk, self._file = update_chunk_file_indices(self._chunk, self._file, self._chunks_size)
        if self._writer is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(self._path, self._schema, compression="snappy", use_dictionary=True)
        self._writer.write_table(self._table(columns))
        return {"data/chunk_index": self._chunk, "data/file_index": self._file}

    @property
    def _path(self) -> Path:
        return self._root / DEFAULT_DATA_PATH.format(chunk_index=self._chunk, file_index=self._file)

    def _table(self, columns: dict[str, np.ndarray]) -> "pa.Table":
        arrays = []
        for field in self._schema:
            values = columns[field.name]
            if pa.types.is_fixed_size_list(field.type):
                flat = pa.array(values.reshape(-1), field.type.value_type)
                arrays.append(pa.FixedSizeListArray.from_arrays(flat, type=field.type))
            else:
                arrays.append(pa.array(values.reshape(-1), field.type))
        return pa.Table.from_arrays(arrays, schema=self._schema)

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
