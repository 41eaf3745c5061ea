"""All that the rules look at: the episodes of a data set side by side, their frames in one run of rows."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..task import PairTask, get_task
from .finding import Finding

COLUMN_TYPES: dict[str, type] = {"str": str, "float": float, "int": np.int64, "bool": bool}
"""How the kinds of episode columns are held in arrays."""


@dataclass(frozen=True, repr=False)
class EpisodeTable:
    """E episodes, and N frames of those F episodes whose frames are all there.

    Attributes:
        kind: `lerobot` or `recordings`.
        fps: frames a second; 0 where it is not known.
        labels: `(E,)` how findings name the episodes.
        columns: the episode columns that are there, `(E,)` each.
        frames: the columns of the frames that are there, `(N, n)` or `(N,)` each.
        framed: `(F,)` places in `labels` of the episodes that have frames, in the order of their frames.
        starts: `(F,)` first frame of each.
        final_states: `(F, n)` the state after the last action, where it was stored.
        info: `meta/info.json` of a LeRobot data set.
        files: how the data files describe the columns of the frames: name to (type, width).
        damage: what kept a part of the data from being read, or contradicts the rest of it.
        episodes: the rows of meta/episodes in the order of `labels`, as they are stored.
        data_files: the episodes that each data file has rows of, by its path below the folder.
        task: that they are of.
    """

    root: Path
    kind: str
    fps: float
    labels: tuple[str, ...]
    columns: dict[str, np.ndarray]
    frames: dict[str, np.ndarray]
    framed: np.ndarray
    starts: np.ndarray
    final_states: np.ndarray | None = None
    info: dict[str, Any] = field(default_factory=dict)
    files: dict[str, tuple[str, int]] = field(default_factory=dict)
    damage: tuple[Finding, ...] = ()
    episodes: Any = None  # a pyarrow.Table, where it was read from one
    data_files: dict[str, frozenset[int]] = field(default_factory=dict)
    task: PairTask = field(default_factory=get_task)

    @property
    def frame_count(self) -> int:
        """N."""
        return len(next(iter(self.frames.values()))) if self.frames else 0

    @property
    def counts(self) -> np.ndarray:
        """`(F,)` frames of each episode."""
        return np.diff(np.append(self.starts, self.frame_count))

    @property
    def ends(self) -> np.ndarray:
        """`(F,)` last frame of each episode."""
        return self.starts + self.counts - 1

    def of_framed(self, column: str) -> np.ndarray:
        """`(F,)` an episode column of the episodes that have frames."""
        return self.columns[column][self.framed]

    def share(self, marks: np.ndarray) -> np.ndarray:
        """`(F,)` share of each episode's frames that a mask `(N,)` marks."""
        return np.add.reduceat(marks.astype(np.int64), self.starts) / self.counts

    def any(self, marks: np.ndarray) -> np.ndarray:
        """`(F,)` whether a mask `(N,)` marks any frame of each episode."""
        return np.logical_or.reduceat(marks, self.starts)

    def longest_run(self, marks: np.ndarray) -> np.ndarray:
        """`(F,)` frames of the longest unbroken run of a mask `(N,)` within each episode."""
        order = np.arange(len(marks))
        # The last place before each frame where a run cannot have been going on.
        broken = np.where(marks, -1, order)
        broken[self.starts] = np.where(marks[self.starts], self.starts - 1, self.starts)
        return np.maximum.reduceat(order - np.maximum.accumulate(broken), self.starts)

    def changes(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Differences of successive frames of the same episode `(M, ...)`, and the later frame of each `(M,)`."""
        inside = np.ones(len(values), bool)
        inside[self.starts] = False
        later = np.flatnonzero(inside)
        return values[later] - values[later - 1], later
