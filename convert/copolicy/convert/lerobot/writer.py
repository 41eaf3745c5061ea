"""Writes a LeRobot v3 data set in one pass: whole episodes as row groups, metadata once at the end.

LeRobot's `add_frame` / `save_episode` spends most of its time on image handling even without images, rewrites the
metadata at every episode, and loses the data set if interrupted. The files are the same, row for row.
"""

import json
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import Downsampling
from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import MissingExtraError, RunError
from copolicy.dataset.features import ACTION, features_of
from copolicy.dataset.files.meta_files import CARD_FILE, RECORD_FILE
from copolicy.dataset.files.staging import new_folder
from copolicy.dataset.lerobot_folder.info import robot_type
from copolicy.dataset.publication.licences import licence_identifier
from copolicy.dataset.publication.minimal_card import write_minimal_card
from copolicy.dataset.task import get_task
from copolicy.dataset.task_spec import TaskSpec

from ..column_statistics import episode_statistics
from ..video.scene_video import SCENE, scene_encoder, scene_feature
from ..video.video_files import VideoFiles
from .frame_files import FrameFiles
from .mixtures import Mixtures
from .prepare import PreparedEpisode, RepeatedEpisodeError

try:
    import pyarrow as pa
    import pyarrow.parquet as pq
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.dataset_metadata import LeRobotDatasetMetadata
    from lerobot.datasets.io_utils import write_info, write_stats
    from lerobot.datasets.utils import DEFAULT_EPISODES_PATH
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None

_ARROW_TYPES = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}


@dataclass(frozen=True)
class WrittenDataset:
    """Facts about a written data set."""

    root: Path
    repo_id: str
    fps: int
    downsampling: Downsampling
    episodes: int
    frames: int
    successes: int
    mixtures: Mixtures

    def summary(self) -> dict[str, Any]:
        """Entries of a command's summary."""
        facts = {name: value for name, value in vars(self).items() if name != "mixtures"}
        return {**facts, "root": str(self.root), **self.mixtures.summary()}


def write_dataset(
    episodes: Iterable[PreparedEpisode],
    root: Path,
    repo_id: str,
    fps: int,
    downsampling: Downsampling,
    record: Callable[[], dict],
    data_file_mb: int | None = None,
    video_file_mb: int | None = None,
) -> WrittenDataset:
    """Writes the episodes, in their order, as a LeRobot v3 data set at `root`.

    The downsampling is stored as the extra key `hold` of the feature `action` in meta/info.json: LeRobot preserves it
    and refuses to merge data sets that differ in it. `record` (versions, sources, skipped episodes, notes by episode)
    and the task spec go to meta/copolicy.json (the robot type in info.json names the task): LeRobot drops extra keys at
    the top of info.json, and inside a feature they would prevent merging data sets of different versions.

    Args:
        episodes: consumed one by one; all have a video, or none has.
        record: returns JSON-able facts about the conversion; called once all episodes are consumed.
        data_file_mb: size limit of a data file, LeRobot's default if None.
        video_file_mb: size limit of a video file, LeRobot's default if None.

    Raises:
        OutputExistsError: `root` exists; it is not changed.
        RunError: no episodes, episodes of several tasks, or two with the same episode_uuid; nothing is written.
    """
    with new_folder(root) as partial:
        iterator = iter(episodes)
        first = next(iterator, None)
        if first is None:
            raise RunError(f"{root}: expected at least one episode to write, found none")
        task = get_task(first.task)
        spec = task.spec
        features = _features(spec, downsampling, first)
        meta = LeRobotDatasetMetadata.create(
            repo_id, fps, features, robot_type(spec.name), partial, use_videos=SCENE in features,
            data_files_size_in_mb=data_file_mb, video_files_size_in_mb=video_file_mb,
        )  # fmt: skip
        meta.save_episode_tasks([spec.sentence])
        rows, statistics, notes = _write_data(chain((first,), iterator), spec, meta)
        _write_episodes(rows, statistics, partial)
        meta.info.total_episodes, meta.info.total_frames = len(rows), rows[-1]["dataset_to_index"]
        meta.info.total_tasks, meta.info.splits = 1, {"train": f"0:{len(rows)}"}
        if SCENE in features:
            meta.update_video_info(SCENE, scene_encoder(fps))
        write_info(meta.info, partial)
        write_stats(aggregate_stats(statistics), partial)
        document = {**record(), "task": spec.to_dict(), "fps": fps, "hold": downsampling, "notes": notes}
        (partial / RECORD_FILE).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
        write_minimal_card(partial / CARD_FILE, {row["license"] for row in rows}, spec.name)
    _warn_of_licences(root, rows)
    successes, frames = sum(row["success"] for row in rows), rows[-1]["dataset_to_index"]
    mixtures = Mixtures.from_rows(rows, task)
    return WrittenDataset(root, repo_id, fps, downsampling, len(rows), frames, successes, mixtures)


def _warn_of_licences(root: Path, rows: list[dict]) -> None:
    """Warns of licences that are no identifier of the Hub, since `copolicy-cards` will refuse them later."""
    unlisted = Counter(row["license"] for row in rows if row["license"] and not licence_identifier(row["license"]))
    for licence, count in unlisted.items():
        logging.warning(
            "warning: %s: %d episodes state the licence %r, which is no identifier of the Hub: "
            "copolicy-cards will refuse it", root, count, licence,
        )  # fmt: skip


def _features(spec: TaskSpec, downsampling: Downsampling, example: PreparedEpisode) -> dict[str, dict]:
    features = features_of(spec)
    action = {**features[ACTION], "hold": downsampling, "record_hz": spec.record_hz}
    video = {SCENE: scene_feature(example.scene.size)} if example.scene else {}
    return {**features, ACTION: action, **video}


def _write_data(
    episodes: Iterable[PreparedEpisode], spec: TaskSpec, meta
) -> tuple[list[dict], list[dict], dict[str, list[str]]]:
    """Writes data and video files; returns rows of meta/episodes, statistics of every episode, and notes by episode."""
    rows: list[dict] = []
    statistics: list[dict] = []
    notes: dict[str, list[str]] = {}
    origins: dict[str, str] = {}
    start = 0
    with (
        FrameFiles(meta.root, meta.features, meta.data_files_size_in_mb, meta.chunks_size) as frames,
        VideoFiles(meta.root, SCENE, meta.fps, meta.video_files_size_in_mb, meta.chunks_size) as videos,
    ):
        for index, episode in enumerate(episodes):
            if episode.task != spec.name:
                expected = f"an episode of the task {spec.name!r}"
                raise RunError(f"{episode.origin}: expected {expected}, found one of {episode.task!r}")
            uuid = episode.meta.episode_uuid
            if uuid in origins:
                raise RepeatedEpisodeError(uuid, origins[uuid], episode.origin or f"episode {index}")
            origins[uuid] = episode.origin or f"episode {index}"
            clock = _clock_columns(index, start, episode.frames, meta.fps)
            end = start + episode.frames
            rows.append(
                {
                    "episode_index": index,
                    "tasks": [spec.sentence],
                    "length": episode.frames,
                    **frames.append({**episode.columns, **clock}),
                    **(videos.append(episode.scene.mp4, episode.frames) if episode.scene else {}),
                    "dataset_from_index": start,
                    "dataset_to_index": end,
                    **asdict(episode.meta),
                    "meta/episodes/chunk_index": 0,
                    "meta/episodes/file_index": 0,
                }
            )
            statistics.append({**episode.statistics, **episode_statistics(clock)})
            if episode.notes:
                notes[uuid] = list(episode.notes)
            start = end
    return rows, statistics, notes


def _clock_columns(index: int, start: int, frames: int, fps: int) -> dict[str, Array]:
    order = np.arange(frames)
    return {
        "timestamp": (order / fps).astype(np.float32),
        "frame_index": order,
        "episode_index": np.full(frames, index),
        "index": start + order,
        "task_index": np.zeros(frames, np.int64),
    }


def _write_episodes(rows: list[dict], statistics: list[dict], root: Path) -> None:
    columns = {}
    for name in rows[0]:
        column_type = _ARROW_TYPES.get(EPISODE_COLUMNS.get(name, ""))
        # NaN (unknown) becomes null, which every parquet reader understands.
        columns[name] = pa.array([row[name] for row in rows], column_type, from_pandas=True)
    for feature, values in statistics[0].items():
        for statistic in values:
            columns[f"stats/{feature}/{statistic}"] = pa.array(
                [entry[feature][statistic].tolist() for entry in statistics]
            )
    path = root / DEFAULT_EPISODES_PATH.format(chunk_index=0, file_index=0)
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path, compression="snappy", use_dictionary=True)
