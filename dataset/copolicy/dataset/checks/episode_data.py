"""All that the rules look at: the episodes of a data set side by side, their frames in one run of rows."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..features import ACTION
from ..task import PairTask, get_task
from .finding import Figure, Finding, Severity
from .limits import limits_of

COLUMN_TYPES: dict[str, type] = {"str": str, "float": float, "int": np.int64, "bool": bool}
"""How the kinds of episode columns are held in arrays."""


@dataclass(frozen=True, repr=False)
class EpisodeData:
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

    def framed_column(self, column: str) -> np.ndarray:
        """`(F,)` an episode column of the episodes that have frames."""
        return self.columns[column][self.framed]

    def share(self, marks: np.ndarray) -> np.ndarray:
        """`(F,)` share of each episode's frames that a mask `(N,)` marks."""
        return np.add.reduceat(marks.astype(np.int64), self.starts) / self.counts

    def count(self, marks: np.ndarray) -> np.ndarray:
        """`(F,)` frames of each episode that a mask `(N,)` marks."""
        return np.add.reduceat(marks.astype(int), self.starts)

    def largest(self, values: np.ndarray) -> np.ndarray:
        """`(F,)` largest of a value `(N,)` in each episode."""
        return np.maximum.reduceat(values, self.starts)

    def player_force(self, player: int) -> np.ndarray:
        """`(N, m)` a player's action in units of its full force."""
        return np.split(self.task.spec.full_forces(self.frames[ACTION]), 2, axis=1)[player]

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

    def limit(self, name: str) -> float:
        """The number of a rule's limit, of the task or a generic one."""
        return limits_of(self.task)[name].value

    def found(
        self, rule: str, where: np.ndarray, figures: np.ndarray, limit: Figure, message: str,
        severity: Severity = "error",
    ) -> Iterator[Finding]:  # fmt: skip
        """One finding for every episode that a mask `(E,)` or `(F,)` marks, with its own figure."""
        places = self.framed if len(where) == len(self.framed) else range(len(self.labels))
        for place in np.flatnonzero(where):
            figure: Any = figures[place]
            plain = figure.item() if isinstance(figure, np.generic) else figure
            yield Finding(self.labels[places[place]], rule, plain, limit, severity, message)

    def beyond(self, rule: str, figures: np.ndarray, message: str, severity: Severity = "error") -> Iterator[Finding]:
        """A finding for every episode whose figure `(E,)` or `(F,)` is over the limit of the rule, or is none."""
        bound = self.limit(rule)
        return self.found(rule, ~(figures <= bound), figures, bound, message, severity)

    def graded(self, rule: str, figures: np.ndarray, message: str) -> Iterator[Finding]:
        """An error over the limit `RULE.error`, a warning over `RULE.warning`."""
        warning, error = self.limit(f"{rule}.warning"), self.limit(f"{rule}.error")
        yield from self.found(rule, figures > error, figures, error, message)
        yield from self.found(rule, (figures > warning) & ~(figures > error), figures, warning, message, "warning")
