"""Rules on timing: late steps, achieved rate, timestamps, duration and length of episodes."""

from collections.abc import Iterator

import numpy as np

from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _late_ticks(data: EpisodeData) -> Iterator[Finding]:
    steps = np.maximum(np.rint(data.columns["duration_s"] * data.task.spec.record_hz), 1)
    yield from data.graded("late_ticks", data.columns["late_ticks"] / steps, "proportion of steps that began late")


def _achieved_hz(data: EpisodeData) -> Iterator[Finding]:
    achieved, hz = data.columns["achieved_hz"], data.task.spec.record_hz
    yield from data.graded(
        "achieved_hz", np.abs(achieved / hz - 1), f"relative deviation of the loop's rate from {hz} Hz"
    )
    unknown = np.isnan(achieved) & (data.columns["source"] == "human")
    if unknown.any():
        message = "episodes of people without the achieved rate of their loop"
        yield Finding("", "achieved_hz", int(unknown.sum()), 0, "warning", message)


def _timestamps(data: EpisodeData) -> Iterator[Finding]:
    frame_index = np.arange(data.frame_count) - np.repeat(data.starts, data.counts)
    stored = data.frames["timestamp"].reshape(-1).astype(float)
    # Single precision at 1000 s resolves 6e-5 s, within the tolerance.
    errors = data.maximum(np.abs(stored - frame_index / data.fps))
    message = "a timestamp does not match its frame: frames are missing or the rate is wrong"
    yield from data.over_limit("timestamp", errors, message)


def _duration(data: EpisodeData) -> Iterator[Finding]:
    errors = np.abs(data.columns["duration_s"] * data.fps - data.columns["length"])
    bound = data.limit("duration")
    message = "duration_s and the number of frames differ by this many frames"
    yield from data.findings("duration", ~(errors <= bound + 1e-6), errors, bound, message)


def _short(data: EpisodeData) -> Iterator[Finding]:
    seconds, bound = data.columns["length"] / data.fps, data.limit("short")
    yield from data.findings("short", seconds < bound, seconds, bound, "the episode lasts this many s", "warning")


RULES = (
    Rule("late_ticks", "steps that began late", _late_ticks, (), ("late_ticks", "duration_s")),
    Rule("achieved_hz", "the rate that the recording loop kept", _achieved_hz, (), ("achieved_hz", "source")),
    Rule("timestamps", "timestamps without gaps", _timestamps, ("timestamp",), (), ("lerobot",)),
    Rule("duration", "as many frames as the duration asks for", _duration, (), ("duration_s",)),
    Rule("jumps", "rule for how fast it can move"),
    Rule("drift", "rule for the drift of a replay"),
)

MOTION_RULES = (Rule("short", "episodes are long enough to learn from", _short), Rule("stuck", "rule for a standstill"))
