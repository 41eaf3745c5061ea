"""The input of the rules: episode columns, and the frames of all episodes concatenated."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..features import ACTION
from ..task import PairTask, get_task
from .finding import Figure, Finding, Severity
from .limits import limits_of

COLUMN_TYPES: dict[str, type] = {"str": str, "float": float, "int": np.int64, "bool": bool}
"""Array type of each type of episode column."""


@dataclass(frozen=True, repr=False)
class EpisodeData:
    """E episodes, and the N frames of the F episodes whose frames are complete.

    Attributes:
        kind: `lerobot` or `recordings`.
        fps: frames per second; 0 if unknown.
        labels: `(E,)` names of the episodes in findings.
        columns: the available episode columns, `(E,)` each.
        frames: the available frame columns, `(N, n)` or `(N,)` each.
        framed: `(F,)` indices into `labels` of the episodes with frames, in the order of their frames.
        starts: `(F,)` first frame of each of these episodes.
        final_states: `(F, n)` state after the last action, if stored.
        info: `meta/info.json` of a LeRobot data set.
        files: type and width of each frame column in the schema of the data files.
        damage: findings for unreadable or contradictory parts of the data.
        episodes: the rows of meta/episodes as stored, in the order of `labels`.
        data_files: for each data file (path below the folder), the episodes with rows in it.
        task: task of the episodes.
    """

    root: Path
    kind: str
    fps: float
    labels: tuple[str, ...]
    columns: dict[str, Array]
    frames: dict[str, Array]
    framed: Array
    starts: Array
    final_states: Array | None = None
    info: dict[str, Any] = field(default_factory=dict)
    files: dict[str, tuple[str, int]] = field(default_factory=dict)
    damage: tuple[Finding, ...] = ()
    episodes: Any = None  # a pyarrow.Table, where it was read from one
    data_files: dict[str, frozenset[int]] = field(default_factory=dict)
    task: PairTask = field(default_factory=get_task)

    @property
    def frame_count(self) -> int:
        """Number of frames, N."""
        return len(next(iter(self.frames.values()))) if self.frames else 0

    @property
    def counts(self) -> Array:
        """`(F,)` number of frames of each episode."""
        return np.diff(np.append(self.starts, self.frame_count))

    @property
    def ends(self) -> Array:
        """`(F,)` last frame of each episode."""
        return self.starts + self.counts - 1

    def framed_column(self, column: str) -> Array:
        """`(F,)` an episode column, for the episodes with frames."""
        return self.columns[column][self.framed]

    def proportion(self, marks: Array) -> Array:
        """`(F,)` proportion of each episode's frames that a mask `(N,)` selects."""
        return np.add.reduceat(marks.astype(np.int64), self.starts) / self.counts

    def count(self, marks: Array) -> Array:
        """`(F,)` number of each episode's frames that a mask `(N,)` selects."""
        return np.add.reduceat(marks.astype(int), self.starts)

    def maximum(self, values: Array) -> Array:
        """`(F,)` maximum of `(N,)` values in each episode."""
        return np.maximum.reduceat(values, self.starts)

    def player_force(self, player: int) -> Array:
        """`(N, m)` a player's action in units of its full force."""
        return np.split(self.task.spec.full_forces(self.frames[ACTION]), 2, axis=1)[player]

    def longest_run(self, marks: Array) -> Array:
        """`(F,)` length of the longest run of a mask `(N,)` in each episode, frames."""
        order = np.arange(len(marks))
        # The last frame up to each frame that is not part of a run.
        last_break = np.where(marks, -1, order)
        last_break[self.starts] = np.where(marks[self.starts], self.starts - 1, self.starts)
        return np.maximum.reduceat(order - np.maximum.accumulate(last_break), self.starts)

    def changes(self, values: Array) -> tuple[Array, Array]:
        """Differences `(M, ...)` of successive frames of an episode, and the index of the later frame `(M,)`."""
        inside = np.ones(len(values), bool)
        inside[self.starts] = False
        later = np.flatnonzero(inside)
        return values[later] - values[later - 1], later

    def limit(self, name: str) -> float:
        """The value of a limit for the task."""
        return limits_of(self.task)[name].value

    def findings(
        self, rule: str, mask: Array, figures: Array, limit: Figure, message: str,
        severity: Severity = "error",
    ) -> Iterator[Finding]:  # fmt: skip
        """A finding for every episode that a mask `(E,)` or `(F,)` selects, with its entry of `figures`."""
        indices = self.framed if len(mask) == len(self.framed) else range(len(self.labels))
        for index in np.flatnonzero(mask):
            value: Any = figures[index]
            figure = value.item() if isinstance(value, np.generic) else value
            yield Finding(self.labels[indices[index]], rule, figure, limit, severity, message)

    def over_limit(self, rule: str, figures: Array, message: str) -> Iterator[Finding]:
        """An error for every episode whose figure `(E,)` or `(F,)` is above the limit of the rule, or NaN."""
        limit = self.limit(rule)
        return self.findings(rule, ~(figures <= limit), figures, limit, message)

    def graded(self, rule: str, figures: Array, message: str) -> Iterator[Finding]:
        """Errors for figures above the limit `RULE.error`, warnings for those above `RULE.warning`."""
        warning, error = self.limit(f"{rule}.warning"), self.limit(f"{rule}.error")
        yield from self.findings(rule, figures > error, figures, error, message)
        yield from self.findings(rule, (figures > warning) & ~(figures > error), figures, warning, message, "warning")
