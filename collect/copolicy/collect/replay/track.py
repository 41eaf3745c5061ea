"""The track of a recorded episode: its poses, forces, interaction and events, by step."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.outline import Pose, interpolate_pose
from copolicy.dataset.recording.reader import read_recording
from copolicy.dataset.task import PairTask, get_task


@dataclass(frozen=True)
class TrackEvent:
    """An event of the recording, and its step."""

    step: int
    kind: str
    detail: str


@dataclass(frozen=True, repr=False)
class Track:
    """The track of an episode of T steps.

    Attributes:
        path: of the recording.
        task: of the episode.
        episode: states, actions, metadata, scenario.
        poses: `T + 1`, see `Outline.poses`; empty if the task has no outline.
        forces: `(T + 1, 4)` robot xy, human xy; zero at the end.
        interaction: `(T,)` interaction measure of each step, in the task's unit; None if the task has none.
        events: of the recording, in order, without start and end.
    """

    path: Path
    task: PairTask
    episode: Episode
    poses: tuple[Pose, ...]
    forces: Array
    interaction: Array | None
    events: tuple[TrackEvent, ...] = ()

    @property
    def steps(self) -> int:
        """Number of steps T, which is also the position of the last state."""
        return len(self.episode.actions)

    @property
    def hz(self) -> int:
        """Steps per second."""
        return self.task.spec.record_hz

    @property
    def seconds(self) -> float:
        """Length in simulated time, s."""
        return self.steps / self.hz

    def pose_at(self, position: float) -> Pose:
        """Returns the pose at a position in [0, T], in steps; interpolated between two states."""
        before = min(int(position), self.steps)
        after = min(before + 1, self.steps)
        return interpolate_pose(self.poses[before], self.poses[after], position - before)

    def forces_at(self, position: float) -> tuple[float, float, float, float]:
        """Returns the forces that act at a position: robot xy, human xy."""
        a, b, c, d = self.forces[min(int(position), self.steps)].tolist()
        return a, b, c, d


def read_track(path: Path | str) -> Track:
    """Reads and verifies a recording.

    Raises:
        FileFormatError: the file is unreadable, damaged, unfinished, or not a recording of an installed task.
    """
    path = Path(path)
    if path.name.endswith(".part"):
        raise FileFormatError(path, "a finished recording", "an unfinished one (see copolicy-collect recover)")
    recording = read_recording(path)
    events = (event for event in recording.events if event.kind not in ("start", "end"))
    track_events = tuple(TrackEvent(event.step, event.kind, event.detail) for event in events)
    return track_from_episode(path, recording.episode, track_events)


def track_from_episode(path: Path, episode: Episode, events: tuple[TrackEvent, ...] = ()) -> Track:
    """Returns the track of an episode in memory."""
    task = get_task(episode.task)
    states = np.vstack((episode.states, episode.final_state))
    poses: tuple[Pose, ...] = ()
    forces = np.zeros((len(states), 4))
    if task.outline is not None:
        poses = tuple((x, y, theta) for x, y, theta in task.outline.poses(states).tolist())
        forces[:-1] = task.outline.forces(episode.actions)
    return Track(path, task, episode, poses, forces, task.interaction(states[1:], episode.actions), events)


def frame_positions(track: Track, frames_per_second: float, speed: float) -> list[float]:
    """Returns the positions of the frames of a video of the whole track, in steps; the last is the end."""
    stride = track.hz * speed / frames_per_second
    positions = itertools.takewhile(lambda position: position < track.steps, itertools.count(0.0, stride))
    return [*positions, float(track.steps)]
