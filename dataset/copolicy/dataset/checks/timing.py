"""Time: late ticks, the rate that was kept, gaps between frames, whether motion fits the clock, and re-simulation."""

from collections.abc import Iterator

import numpy as np

from ..features import STATE
from ..task_spec import RECORD_HZ
from .episode_table import EpisodeTable
from .finding import Finding
from .limits import limit
from .rule import Rule, each


def _late_ticks(table: EpisodeTable) -> Iterator[Finding]:
    steps = np.maximum(np.rint(table.columns["duration_s"] * RECORD_HZ), 1)
    yield from _two_limits(table, "late_ticks", table.columns["late_ticks"] / steps, "share of steps that began late")


def _achieved_hz(table: EpisodeTable) -> Iterator[Finding]:
    kept = table.columns["achieved_hz"]
    off = np.abs(kept / RECORD_HZ - 1)
    yield from _two_limits(table, "achieved_hz", off, "the loop's rate was this share away from 30 Hz")
    unknown = np.isnan(kept) & (table.columns["source"] == "human")
    if unknown.any():
        message = "episodes of people that do not tell the rate their loop kept"
        yield Finding("", "achieved_hz", int(unknown.sum()), 0, "warning", message)


def _two_limits(table: EpisodeTable, rule: str, figures: np.ndarray, message: str) -> Iterator[Finding]:
    warning, error = limit(f"{rule}.warning"), limit(f"{rule}.error")
    yield from each(table, figures > error, rule, figures, error, "error", message)
    yield from each(table, (figures > warning) & ~(figures > error), rule, figures, warning, "warning", message)


def _timestamps(table: EpisodeTable) -> Iterator[Finding]:
    place = np.arange(table.frame_count) - np.repeat(table.starts, table.counts)
    stored = table.frames["timestamp"].reshape(-1).astype(float)
    # Single precision at 1000 s resolves 6e-5 s, within the tolerance.
    off = np.maximum.reduceat(np.abs(stored - place / table.fps), table.starts)
    bound = limit("timestamp")
    message = "a timestamp is not its frame's; frames are missing or the rate is another"
    yield from each(table, ~(off <= bound), "timestamp", off, bound, "error", message, table.framed)


def _duration(table: EpisodeTable) -> Iterator[Finding]:
    off = np.abs(table.columns["duration_s"] * table.fps - table.columns["length"])
    bound = limit("duration")
    message = "duration_s and the number of frames differ by this many frames"
    yield from each(table, ~(off <= bound + 1e-6), "duration", off, bound, "error", message)


def _jumps(table: EpisodeTable) -> Iterator[Finding]:
    moved, later = table.changes(table.frames[STATE][:, :2].astype(float))
    speed = np.zeros(table.frame_count)
    speed[later] = np.abs(moved).max(axis=1) * table.fps
    fastest = np.maximum.reduceat(speed, table.starts)
    bound = limit("jump")
    message = "the table moved faster between two frames than it can; steps are missing"
    yield from each(table, ~(fastest <= bound), "jump", fastest, bound, "error", message, table.framed)


def _drift(table: EpisodeTable) -> Iterator[Finding]:
    drift = table.columns["replay_drift_px"]
    warning, error = limit("drift.warning"), limit("drift.error")
    message = "the actions, played again, leave the recorded path by this many px"
    yield from each(table, drift > error, "drift", drift, error, "error", message)
    yield from each(table, (drift > warning) & ~(drift > error), "drift", drift, warning, "warning", message)
    unknown = int(np.isnan(drift).sum())
    if unknown:
        message = "episodes were not re-simulated (stored below 30 Hz, or converted with --no-drift)"
        yield Finding("", "drift", unknown, 0, "info", message)


RULES = (
    Rule("late_ticks", "steps that began late", _late_ticks, (), ("late_ticks", "duration_s")),
    Rule("achieved_hz", "the rate that the recording loop kept", _achieved_hz, (), ("achieved_hz", "source")),
    Rule("timestamps", "timestamps without gaps", _timestamps, ("timestamp",), (), ("lerobot",)),
    Rule("duration", "as many frames as the duration asks for", _duration, (), ("duration_s",)),
    Rule("jumps", "no step is missing from the motion", _jumps, (STATE,)),
    Rule("drift", "re-simulation follows the recorded path", _drift, (), ("replay_drift_px",), ("lerobot",)),
)
