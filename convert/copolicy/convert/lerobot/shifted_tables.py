"""Shifts the numbers in the tables of one LeRobot v3 data set so that its episodes follow those of another."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files.meta_files import EPISODES_FOLDER
from copolicy.dataset.lerobot_folder.references import FileIndex, chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
except ModuleNotFoundError:
    raise MissingExtraError("pyarrow") from None

_NUMBER_COLUMNS = ("chunk_index", "file_index")
_UNSHIFTED = ("count", "std")  # statistics that do not change when a constant is added to the values


@dataclass(frozen=True)
class Shift:
    """Offsets added to the numbers of episodes and frames."""

    episodes: int
    frames: int

    @property
    def columns(self) -> dict[str, int]:
        """Offset of each shifted column of the frames."""
        return {"episode_index": self.episodes, "index": self.frames}

    def statistics(self, statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
        """Shifts the statistics of a data set, given by feature and statistic."""
        return {
            feature: {
                name: value if name in _UNSHIFTED else value + self.columns.get(feature, 0)
                for name, value in values.items()
            }
            for feature, values in statistics.items()
        }

    def frame_table(self, table: "pa.Table") -> "pa.Table":
        """Shifts a table of frames."""
        for name, offset in self.columns.items():
            table = _shifted(table, name, offset)
        return table

    def episode_table(
        self, table: "pa.Table", moved_files: Mapping[str, Mapping[FileIndex, FileIndex]], own: FileIndex
    ) -> "pa.Table":
        """Shifts a table of meta/episodes.

        Args:
            moved_files: for each folder of numbered files (`data`, `videos/KEY`), old to new chunk and file numbers.
            own: chunk and file number that the table itself gets.
        """
        offsets = {
            "episode_index": self.episodes,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames,
        }
        for name, offset in offsets.items():
            table = _shifted(table, name, offset)
        for folder, moved in moved_files.items():
            columns = (table.column(f"{folder}/{part}").to_pylist() for part in _NUMBER_COLUMNS)
            table = _with_numbers(table, folder, [moved[number] for number in zip(*columns, strict=True)])
        table = _with_numbers(table, "meta/episodes", [own] * table.num_rows)
        for name in table.column_names:
            feature, _, statistic = name.removeprefix("stats/").rpartition("/")
            if name.startswith("stats/") and feature in self.columns and statistic not in _UNSHIFTED:
                offset = self.columns[feature]
                rows = [[value + offset for value in row] for row in table.column(name).to_pylist()]
                table = replace_column(table, name, rows)
        return table


def write_with_schema(table: "pa.Table", example: "Path | pa.Schema", path: Path) -> None:
    """Writes a table with the column order and types of a schema or of another file.

    Raises:
        FileFormatError: `example` has other columns than the table.
    """
    schema = pq.read_schema(example) if isinstance(example, Path) else example
    if sorted(schema.names) != sorted(table.column_names):
        differ = sorted(set(schema.names) ^ set(table.column_names))
        raise FileFormatError(
            str(example), f"columns {', '.join(sorted(table.column_names)[:4])}, ...", f"not {differ[:4]}"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.select(schema.names).cast(schema), path, compression="snappy", use_dictionary=True)


def read_episode_columns(root: Path) -> list[dict[str, Any]]:
    """Reads the episode columns that a data set has, one dict per episode."""
    tables = [read_parquet(path) for path in chunk_files(root / EPISODES_FOLDER).values()]
    return [
        row
        for table in tables
        for row in table.select([name for name in EPISODE_COLUMNS if name in table.column_names]).to_pylist()
    ]


def _with_numbers(table: "pa.Table", folder: str, numbers: list[FileIndex]) -> "pa.Table":
    for part, name in enumerate(_NUMBER_COLUMNS):
        table = replace_column(table, f"{folder}/{name}", [number[part] for number in numbers])
    return table


def _shifted(table: "pa.Table", name: str, offset: int) -> "pa.Table":
    return replace_column(table, name, [value + offset for value in table.column(name).to_pylist()])


def replace_column(table: "pa.Table", name: str, values: Any) -> "pa.Table":
    """Replaces the values of a column; keeps its type."""
    index = table.column_names.index(name)
    field = table.schema.field(index)
    return table.set_column(
        index, field, values if isinstance(values, pa.ChunkedArray) else pa.array(values, field.type)
    )
