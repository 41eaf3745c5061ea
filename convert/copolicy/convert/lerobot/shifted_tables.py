"""The tables of one LeRobot v3 data set as they are when its episodes follow those of another."""

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

_PLACE = ("chunk_index", "file_index")
_COUNTED = ("count", "std")  # statistics that do not move with the values


@dataclass(frozen=True)
class Shift:
    """How far episodes and frames move."""

    episodes: int
    frames: int

    @property
    def columns(self) -> dict[str, int]:
        """The columns of the frames that move."""
        return {"episode_index": self.episodes, "index": self.frames}

    def statistics(self, statistics: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
        """Statistics of a data set, by feature and kind."""
        return {
            name: {
                kind: value if kind in _COUNTED else value + self.columns.get(name, 0) for kind, value in kinds.items()
            }
            for name, kinds in statistics.items()
        }

    def frame_table(self, table: "pa.Table") -> "pa.Table":
        """A table of frames."""
        for name, by in self.columns.items():
            table = _added(table, name, by)
        return table

    def episode_table(
        self, table: "pa.Table", moved_files: Mapping[str, Mapping[FileIndex, FileIndex]], own: FileIndex
    ) -> "pa.Table":
        """A table of meta/episodes.

        Args:
            moved_files: for each folder of numbered files (`data`, `videos/KEY`), where each file went.
            own: where the table itself goes.
        """
        moved = {
            "episode_index": self.episodes,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames,
        }
        for name, by in moved.items():
            table = _added(table, name, by)
        for folder, places in moved_files.items():
            numbers = (table.column(f"{folder}/{part}").to_pylist() for part in _PLACE)
            table = _placed(table, folder, [places[place] for place in zip(*numbers, strict=True)])
        table = _placed(table, "meta/episodes", [own] * table.num_rows)
        for name in table.column_names:
            feature, _, kind = name.removeprefix("stats/").rpartition("/")
            if name.startswith("stats/") and feature in self.columns and kind not in _COUNTED:
                by = self.columns[feature]
                rows = [[value + by for value in row] for row in table.column(name).to_pylist()]
                table = replaced(table, name, rows)
        return table


def write_like(table: "pa.Table", example: "Path | pa.Schema", path: Path) -> None:
    """Writes a table with the columns, their order and their types, of another file or of a schema.

    Raises:
        FileFormatError: the other file has other columns.
    """
    schema = pq.read_schema(example) if isinstance(example, Path) else example
    if sorted(schema.names) != sorted(table.column_names):
        differ = sorted(set(schema.names) ^ set(table.column_names))
        raise FileFormatError(
            str(example), f"columns {', '.join(sorted(table.column_names)[:4])}, ...", f"not {differ[:4]}"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.select(schema.names).cast(schema), path, compression="snappy", use_dictionary=True)


def episode_rows(root: Path) -> list[dict[str, Any]]:
    """The episode columns of each episode of a data set, as far as it has them."""
    tables = [read_parquet(path) for path in chunk_files(root / EPISODES_FOLDER).values()]
    return [
        row
        for table in tables
        for row in table.select([name for name in EPISODE_COLUMNS if name in table.column_names]).to_pylist()
    ]


def _placed(table: "pa.Table", folder: str, places: list[FileIndex]) -> "pa.Table":
    for part, name in enumerate(_PLACE):
        table = replaced(table, f"{folder}/{name}", [place[part] for place in places])
    return table


def _added(table: "pa.Table", name: str, by: int) -> "pa.Table":
    return replaced(table, name, [value + by for value in table.column(name).to_pylist()])


def replaced(table: "pa.Table", name: str, values: Any) -> "pa.Table":
    """A table with other values in a column, of its type."""
    place = table.column_names.index(name)
    field = table.schema.field(place)
    return table.set_column(
        place, field, values if isinstance(values, pa.ChunkedArray) else pa.array(values, field.type)
    )
