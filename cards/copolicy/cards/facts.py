"""Reads the facts that a card of a data set states, from the data set's folder only."""

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.features import features_of
from copolicy.dataset.files.meta_files import INFO_FILE
from copolicy.dataset.lerobot_folder.folder import LeRobotFolder
from copolicy.dataset.task import PairTask
from copolicy.dataset.task_words import TaskWords


@dataclass(frozen=True)
class DatasetFacts:
    """The metadata of a LeRobot v3 data set and its episodes.

    Attributes:
        episodes: one dict per episode with its episode columns and `length` (frames).
    """

    folder: LeRobotFolder
    episodes: tuple[dict[str, Any], ...]

    @classmethod
    def read(cls, root: Path | str) -> "DatasetFacts":
        """Reads a data set folder.

        Raises:
            FileFormatError: no LeRobot v3 data set, one without the episode columns, or one that contradicts itself.
        """
        root = Path(root)
        folder = LeRobotFolder.open(root)
        folder.require_task(tuple(features_of(folder.task.spec)))
        episodes = tuple(folder.rows())
        count, frames = folder.info["total_episodes"], folder.info["total_frames"]
        if len(episodes) != count or sum(folder.lengths) != frames:
            contents = f"{len(episodes)} episodes with {sum(folder.lengths)} frames"
            raise FileFormatError(root / INFO_FILE, f"{count} episodes with {frames} frames in meta/episodes", contents)
        return cls(folder, episodes)

    @property
    def root(self) -> Path:
        """The folder of the data set."""
        return self.folder.root

    @property
    def task(self) -> PairTask:
        """The task of the episodes."""
        return self.folder.task

    @property
    def words(self) -> TaskWords:
        """The phrases of the task."""
        return self.task.words

    @property
    def info(self) -> dict[str, Any]:
        """`meta/info.json`."""
        return self.folder.info

    def counts(self, column: str) -> dict[str, int]:
        """Number of episodes with each value of a column, most frequent first."""
        counter = Counter(str(episode[column]) for episode in self.episodes)
        return dict(sorted(counter.items(), key=lambda item: (-item[1], item[0])))

    def values(self, column: str) -> list[str]:
        """Distinct non-empty values of a column, sorted."""
        return sorted({str(episode[column]) for episode in self.episodes} - {""})

    @property
    def seconds(self) -> float:
        """Total recorded time, s; computed from the frames for an episode without a duration."""
        fps = self.info["fps"]
        times = ((episode["duration_s"], episode["length"] / fps) for episode in self.episodes)
        return sum(stated if math.isfinite(stated) else counted for stated, counted in times)

    @property
    def successes(self) -> int:
        """Number of successful episodes."""
        return sum(bool(episode["success"]) for episode in self.episodes)
