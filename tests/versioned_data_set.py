"""A small converted data set, and ways to change one on disk that the tests of versions and of the Hub share."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from made_once import simulated

from copolicy.convert.cli import main as convert

EPISODES = "meta/episodes/chunk-000/file-000.parquet"
FRAMES = "data/chunk-000/file-000.parquet"
COUNT = 6


def simulated_data_set(root: Path) -> Path:
    """Six simulated episodes as a data set with a card; their recordings lie beside it in `recordings/`."""
    recordings = root.parent / "recordings"
    simulated(recordings, COUNT, seed=1)
    assert convert(["mcap", str(recordings), "--out", str(root), "--repo-id", "lab/table", "--license", "mit"]) == 0
    (root / "README.md").write_text("---\nlicense: mit\n---\n\n# Table\n", encoding="utf-8")
    return root


def change_table(root: Path, file: str, change: Callable[[pa.Table], pa.Table], **options: Any) -> None:
    """Rewrites a Parquet file."""
    table = change(pq.read_table(root / file))
    pq.write_table(table, root / file, **options)


def set_value(root: Path, file: str, column: str, row: int, value: Any) -> None:
    """Overwrites one value; a number in a list is named by `column[place]`."""
    name, _, place = column.partition("[")

    def change(table: pa.Table) -> pa.Table:
        values = table.column(name).to_pylist()
        if place:
            values[row][int(place[:-1])] = value
        else:
            values[row] = value
        position = table.schema.get_field_index(name)
        return table.set_column(position, table.field(name), pa.array(values, table.field(name).type))

    change_table(root, file, change)


def change_json(root: Path, file: str, change: Callable[[dict], object]) -> None:
    """Rewrites a JSON file after `change` has worked on what it holds."""
    fields = json.loads((root / file).read_text(encoding="utf-8"))
    change(fields)
    (root / file).write_text(json.dumps(fields), encoding="utf-8")


def keep_episodes(root: Path, places: list[int]) -> None:
    """Keeps some episodes, in this order, as if no other had ever been there."""
    episodes, frames = pq.read_table(root / EPISODES), pq.read_table(root / FRAMES)
    begins, ends = (episodes.column(f"dataset_{side}_index").to_pylist() for side in ("from", "to"))
    kept = pa.concat_tables([frames.slice(begins[place], ends[place] - begins[place]) for place in places])
    lengths = np.array([ends[place] - begins[place] for place in places])
    stops = np.cumsum(lengths)
    numbers = {"index": np.arange(len(kept)), "episode_index": np.repeat(np.arange(len(places)), lengths)}
    rows = episodes.take(places)
    places_columns = {
        "episode_index": np.arange(len(places)),
        "dataset_from_index": stops - lengths,
        "dataset_to_index": stops,
    }
    pq.write_table(_replaced(kept, numbers), root / FRAMES)
    pq.write_table(_replaced(rows, places_columns), root / EPISODES)
    change_json(
        root,
        "meta/info.json",
        lambda info: info.update(
            total_episodes=len(places), total_frames=len(kept), splits={"train": f"0:{len(places)}"}
        ),
    )


def cut_differently(root: Path) -> None:
    """Another layout of the same data: files, chunks, row groups, compression, order of rows and of columns."""
    frames, episodes = pq.read_table(root / FRAMES), pq.read_table(root / EPISODES)
    half = episodes.column("dataset_to_index")[2].as_py()
    (root / FRAMES).unlink()
    (root / EPISODES).unlink()
    # The later half lies in the earlier file.
    _write(frames.slice(0, half), root / "data/chunk-001/file-000.parquet", compression="zstd", row_group_size=17)
    _write(frames.slice(half), root / "data/chunk-000/file-003.parquet", compression="none", use_dictionary=False)
    chunks = {"data/chunk_index": np.array([1] * 3 + [0] * 3), "data/file_index": np.array([0] * 3 + [3] * 3)}
    episodes = _replaced(episodes, chunks)
    _write(episodes.slice(0, 2), root / "meta/episodes/chunk-000/file-001.parquet", compression="gzip")
    _write(episodes.slice(2), root / "meta/episodes/chunk-000/file-000.parquet")


def _write(table: pa.Table, path: Path, **options: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table.select(table.column_names[::-1]), path, **options)


def _replaced(table: pa.Table, columns: dict[str, np.ndarray]) -> pa.Table:
    for name, values in columns.items():
        position = table.schema.get_field_index(name)
        table = table.set_column(position, table.field(name), pa.array(values, table.field(name).type))
    return table
