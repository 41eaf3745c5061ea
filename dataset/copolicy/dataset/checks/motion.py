"""Episodes that are too short, or in which the table went nowhere."""

from collections.abc import Iterator

import numpy as np

from ..features import STATE
from .episode_table import EpisodeTable
from .finding import Finding
from .limits import limit
from .rule import Rule, each


def _short(table: EpisodeTable) -> Iterator[Finding]:
    seconds = table.columns["length"] / table.fps
    bound = limit("short")
    yield from each(table, seconds < bound, "short", seconds, bound, "warning", "the episode lasts this many s")


def _stuck(table: EpisodeTable) -> Iterator[Finding]:
    states = table.frames[STATE].astype(float)
    still = np.hypot(states[:, 4], states[:, 5]) < limit("stuck_speed")
    seconds = table.longest_run(still) / table.fps
    bound = limit("stuck")
    yield from each(
        table, seconds > bound, "stuck", seconds, bound, "warning", "the table rested this many s at a stretch",
        table.framed,
    )  # fmt: skip
    origin = np.repeat(states[table.starts, :2], table.counts, axis=0)
    farthest = np.maximum.reduceat(np.linalg.norm(states[:, :2] - origin, axis=1), table.starts)
    bound = limit("unmoved")
    long_enough = table.counts / table.fps >= limit("short")
    yield from each(
        table, (farthest < bound) & long_enough, "unmoved", farthest, bound, "warning",
        "the table was never farther than this many px from where it began", table.framed,
    )  # fmt: skip


RULES = (
    Rule("short", "episodes are long enough to learn from", _short),
    Rule("stuck", "the table moves", _stuck, (STATE,)),
)
