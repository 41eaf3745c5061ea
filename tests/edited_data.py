"""Data sets that the tests of select, split, withdraw and amend share: recorded by scripted pairs, named as people."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from checked_data import EPISODES, make_data_set, make_recordings, set_columns
from lerobot.datasets import LeRobotDataset

from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.digests import EpisodeContent

COUNT = 8
PAIRS = ["P01", "P01", "P02", "P02", "P03", "P03", "P04", "P04"]
CONSENTS = ["C-1,C-2", "C-1,C-2", "C-3", "C-3", "C-2", "C-2", "C-9", ""]


def make_people(folder: Path, *flags: str, episodes: int = COUNT) -> Path:
    """A data set at `folder/set` of episodes that say that people played them; `folder/recordings` behind it."""
    root = make_data_set(make_recordings(folder / "recordings", episodes, seed=3), folder / "set", *flags)
    set_columns(
        root,
        source=["human"] * episodes,
        pair_id=PAIRS[:episodes],
        player_0_id=[f"{pair}-a" for pair in PAIRS[:episodes]],
        player_1_id=[f"{pair}-b" for pair in PAIRS[:episodes]],
        consent_id=CONSENTS[:episodes],
    )
    return root


def columns(root: Path) -> list[dict[str, Any]]:
    """The rows of meta/episodes without statistics."""
    tables = [pq.ParquetFile(path).read() for path in sorted((root / "meta" / "episodes").rglob("*.parquet"))]
    names = [name for name in tables[0].column_names if not name.startswith("stats/")]
    return [row for table in tables for row in table.select(names).to_pylist()]


def digests(root: Path) -> dict[str, EpisodeContent]:
    """What each episode holds, by `episode_uuid`."""
    return {episode.episode_uuid: episode for episode in read_content(root).episodes}


def info(root: Path) -> dict[str, Any]:
    return json.loads((root / "meta" / "info.json").read_text(encoding="utf-8"))


def load(root: Path, **options: Any) -> Any:
    """With LeRobot; torchcodec, its first choice, needs ffmpeg's libraries on the machine."""
    return LeRobotDataset("lab/table", root=root, video_backend="pyav", **options)


def episode_statistics(root: Path) -> list[dict[str, dict[str, np.ndarray]]]:
    """The statistics of each episode as LeRobot's `aggregate_stats` takes them."""
    table = pq.ParquetFile(root / EPISODES).read()
    result: list[dict[str, dict[str, np.ndarray]]] = [{} for _ in range(table.num_rows)]
    for name in (name for name in table.column_names if name.startswith("stats/")):
        feature, _, kind = name.removeprefix("stats/").rpartition("/")
        for row, value in enumerate(table.column(name).to_pylist()):
            result[row].setdefault(feature, {})[kind] = np.array(value)
    return result


def split_files(root: Path, parts: list[range]) -> None:
    """Cuts the one data file into several, as a long recording has."""
    path = root / "data/chunk-000/file-000.parquet"
    with pq.ParquetFile(path) as file:
        frames = file.read()
    owners = np.array(frames.column("episode_index").to_pylist())
    for number, part in enumerate(parts):
        rows = pa.array(np.flatnonzero(np.isin(owners, list(part))))
        pq.write_table(frames.take(rows), root / f"data/chunk-000/file-{number:03d}.parquet")
    numbers = [next(n for n, part in enumerate(parts) if episode in part) for episode in range(sum(map(len, parts)))]
    set_columns(root, **{"data/file_index": numbers})
