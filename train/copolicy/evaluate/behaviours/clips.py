"""Short videos of the clearest instance of each behaviour."""

from pathlib import Path

import numpy as np

from copolicy.collect.replay.track import TrackEvent, track_from_episode
from copolicy.collect.replay.video import write_gif
from copolicy.dataset.episode import Episode, EpisodeMeta, termination_reasons
from copolicy.dataset.task import PairTask

from ..trajectories import Trajectory
from .motion import Event

LONGEST_S = 12.0
"""Longest video, s; a longer instance is shown faster."""

MARGIN_S = 1.0
"""Time that a video shows before and after an instance, s."""


def write_clip(path: Path, task: PairTask, trajectory: Trajectory, event: Event, fps: int, title: str) -> None:
    """Writes an instance as a GIF, replaced if it exists.

    Args:
        fps: frames per second by which the event counts.
        title: at the top of the video.
    """
    begin, hz = max(0.0, event.first / fps - MARGIN_S), task.spec.record_hz
    episode = _cut(task, trajectory, begin, event.end / fps + MARGIN_S)
    marks = tuple(
        TrackEvent(round((frame / fps - begin) * hz), "note", text)
        for frame, text in ((event.first, "begins"), (event.end, "ends"))
    )
    track = track_from_episode(Path(title), episode, marks)
    path.unlink(missing_ok=True)
    write_gif(track, path, speed=max(1.0, track.seconds / LONGEST_S))


def _cut(task: PairTask, trajectory: Trajectory, begin_s: float, end_s: float) -> Episode:
    """The part of an episode from `begin_s` to `end_s`, at the task's rate; states between frames are interpolated."""
    hz, columns = task.spec.record_hz, trajectory.columns
    states = trajectory.every_state
    end_s = min(end_s, (len(states) - 1) / trajectory.fps)
    times = np.arange(round(begin_s * hz), round(end_s * hz) + 1) / hz * trajectory.fps
    frame = np.minimum(times.astype(int), len(trajectory.actions) - 1)
    cut = np.column_stack([np.interp(times, np.arange(len(states)), column) for column in states.T])
    reason = str(columns.get("reason", columns.get("termination_reason", "unknown")))
    meta = EpisodeMeta(
        str(columns.get("episode_uuid", "")),
        map_id=str(columns.get("map_id", "")),
        success=bool(columns["success"]),
        termination_reason=reason if reason in termination_reasons(task.spec) else "unknown",
    )
    return Episode(
        cut[:-1],
        trajectory.actions[frame[:-1]].astype(float),
        cut[-1],
        meta,
        trajectory.scenario,
        hz,
        task=task.spec.name,
    )
