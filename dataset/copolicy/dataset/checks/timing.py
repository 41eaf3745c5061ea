"""Time: late ticks, the rate that was kept, gaps between frames, whether motion fits the clock, and re-simulation."""

from collections.abc import Iterator

import numpy as np

from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _late_ticks(table: EpisodeData) -> Iterator[Finding]:
    steps = np.maximum(np.rint(table.columns["duration_s"] * table.task.spec.record_hz), 1)
    yield from table.graded("late_ticks", table.columns["late_ticks"] / steps, "share of steps that began late")


def _achieved_hz(table: EpisodeData) -> Iterator[Finding]:
    kept, hz = table.columns["achieved_hz"], table.task.spec.record_hz
    yield from table.graded("achieved_hz", np.abs(kept / hz - 1), f"the loop's rate was this share away from {hz} Hz")
    unknown = np.isnan(kept) & (table.columns["source"] == "human")
    if unknown.any():
        message = "episodes of people that do not tell the rate their loop kept"
        yield Finding("", "achieved_hz", int(unknown.sum()), 0, "warning", message)


def _timestamps(table: EpisodeData) -> Iterator[Finding]:
    place = np.arange(table.frame_count) - np.repeat(table.starts, table.counts)
    stored = table.frames["timestamp"].reshape(-1).astype(float)
    # Single precision at 1000 s resolves 6e-5 s, within the tolerance.
    off = table.largest(np.abs(stored - place / table.fps))
    message = "a timestamp is not its frame's; frames are missing or the rate is another"
    yield from table.beyond("timestamp", off, message)


def _duration(table: EpisodeData) -> Iterator[Finding]:
    off = np.abs(table.columns["duration_s"] * table.fps - table.columns["length"])
    bound = table.limit("duration")
    message = "duration_s and the number of frames differ by this many frames"
    yield from table.found("duration", ~(off <= bound + 1e-6), off, bound, message)


def _short(table: EpisodeData) -> Iterator[Finding]:
    seconds, bound = table.columns["length"] / table.fps, table.limit("short")
    yield from table.found("short", seconds < bound, seconds, bound, "the episode lasts this many s", "warning")


RULES = (
    Rule("late_ticks", "steps that began late", _late_ticks, (), ("late_ticks", "duration_s")),
    Rule("achieved_hz", "the rate that the recording loop kept", _achieved_hz, (), ("achieved_hz", "source")),
    Rule("timestamps", "timestamps without gaps", _timestamps, ("timestamp",), (), ("lerobot",)),
    Rule("duration", "as many frames as the duration asks for", _duration, (), ("duration_s",)),
    Rule("jumps", "rule for how fast it can move"),
    Rule("drift", "rule for the drift of a replay"),
)

MOTION_RULES = (Rule("short", "episodes are long enough to learn from", _short), Rule("stuck", "rule for a standstill"))
