"""Writes the data files of a LeRobot v3 data set, one row group per episode."""

from pathlib import Path

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import MissingExtraError

from ..numbered_files import NumberedFiles

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
    from lerobot.datasets.feature_utils import get_hf_features_from_features
    from lerobot.datasets.utils import DEFAULT_DATA_PATH
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


class FrameFiles(NumberedFiles):
    """The data files: `data/chunk-000/file-000.parquet`, ..."""

    def __init__(self, root: Path, features: dict[str, dict], file_mb: float, chunks_size: int):
        super().__init__(root, DEFAULT_DATA_PATH, file_mb, chunks_size)
        self._schema = get_hf_features_from_features(features).arrow_schema

    def append(self, columns: dict[str, Array]) -> dict[str, int]:
        """Appends an episode's columns, `(T,)` or `(T, n)`; returns its data file columns of meta/episodes."""
        if self._writer is not None and self._path.stat().st_size >= self._limit:
            self._next()
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._new_path(), self._schema, compression="snappy", use_dictionary=True)
        self._writer.write_table(self._table(columns))
        return {"data/chunk_index": self._chunk, "data/file_index": self._file}

    def _table(self, columns: dict[str, Array]) -> "pa.Table":
        arrays = []
        for field in self._schema:
            values = columns[field.name]
            if pa.types.is_fixed_size_list(field.type):
                flat = pa.array(values.reshape(-1), field.type.value_type)
                arrays.append(pa.FixedSizeListArray.from_arrays(flat, type=field.type))
            else:
                arrays.append(pa.array(values.reshape(-1), field.type))
        return pa.Table.from_arrays(arrays, schema=self._schema)
