"""Checks of the table's motion: inside the window, not too fast, not stuck, and reproduced by re-simulation."""

from collections.abc import Iterator

import numpy as np

from copolicy.dataset.checks.episode_data import EpisodeData
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.features import STATE
from copolicy.dataset.task_parts import Rule


def _jumps(table: EpisodeData) -> Iterator[Finding]:
    moved, later = table.changes(table.frames[STATE][:, :2].astype(float))
    speed = np.zeros(table.frame_count)
    speed[later] = np.abs(moved).max(axis=1) * table.fps
    message = "the table moved faster between two frames than it can; steps are missing"
    yield from table.over_limit("jump", table.maximum(speed), message)


def _drift(table: EpisodeData) -> Iterator[Finding]:
    drift = table.columns["replay_drift_px"]
    yield from table.graded("drift", drift, "the re-simulated actions leave the recorded path by this many px")
    unknown = int(np.isnan(drift).sum())
    if unknown:
        message = "episodes were not re-simulated (stored below 30 Hz, or converted with --no-drift)"
        yield Finding("", "drift", unknown, 0, "info", message)


def _state_range(table: EpisodeData) -> Iterator[Finding]:
    states = table.frames[STATE].astype(float)
    low, high = table.task.spec.state.bounds
    worst = table.maximum(np.maximum(low - states, states - high)[:, :2].max(axis=1))
    message = "the table's centre is this many px outside the window"
    yield from table.findings("state_range", worst > 0, worst, 0.0, message)
    off, bound = table.maximum(np.abs(states[:, 2] ** 2 + states[:, 3] ** 2 - 1)), table.limit("unit_circle")
    yield from table.findings("state_range", off > bound, off, bound, "cos_theta and sin_theta are not of one angle")


def _stuck(table: EpisodeData) -> Iterator[Finding]:
    states = table.frames[STATE].astype(float)
    still = np.hypot(states[:, 4], states[:, 5]) < table.limit("stuck_speed")
    seconds, bound = table.longest_run(still) / table.fps, table.limit("stuck")
    message = "the table was at rest for this many s without a break"
    yield from table.findings("stuck", seconds > bound, seconds, bound, message, "warning")
    origin = np.repeat(states[table.starts, :2], table.counts, axis=0)
    farthest, bound = table.maximum(np.linalg.norm(states[:, :2] - origin, axis=1)), table.limit("unmoved")
    long_enough = table.counts / table.fps >= table.limit("short")
    message = "the table was never farther than this many px from where it began"
    yield from table.findings("unmoved", (farthest < bound) & long_enough, farthest, bound, message, "warning")


RULES = (
    Rule("jumps", "no step is missing from the motion", _jumps, (STATE,)),
    Rule("drift", "re-simulation follows the recorded path", _drift, (), ("replay_drift_px",), ("lerobot",)),
    Rule("state_range", "the table is in the window, cosine and sine are of one angle", _state_range, (STATE,)),
    Rule("stuck", "the table moves", _stuck, (STATE,)),
)
