"""A recording as what can be shown of it at any moment."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.outline import Pose, interpolate_pose
from copolicy.dataset.recording.reader import Recording, read_recording
from copolicy.dataset.task import PairTask, get_task


@dataclass(frozen=True)
class Moment:
    """Something that happened at a step."""

    step: int
    kind: str
    detail: str


@dataclass(frozen=True, repr=False)
class Track:
    """An episode of T steps.

    Attributes:
        path: of the recording.
        task: of the episode.
        episode: states, actions, metadata, scenario.
        poses: `T + 1`, see `Outline.poses`; none where the task has no outline.
        forces: `(T + 1, 4)` robot xy, human xy; zero at the end.
        interaction: `(T,)` interaction force of each step, units of a player's full force; positive pulls apart; None
            where the task measures none.
        moments: what happened, in order, without start and end.
    """

    path: Path
    task: PairTask
    episode: Episode
    poses: tuple[Pose, ...]
    forces: np.ndarray
    interaction: np.ndarray | None
    moments: tuple[Moment, ...] = ()

    @property
    def steps(self) -> int:
        """T, and the position of the last state."""
        return len(self.episode.actions)

    @property
    def hz(self) -> int:
        """Steps a second."""
        return self.task.spec.record_hz

    @property
    def seconds(self) -> float:
        """Length in simulated time."""
        return self.steps / self.hz

    def pose_at(self, position: float) -> Pose:
        """The pose at a position between 0 and T, steps; between two states a way between them."""
        before = min(int(position), self.steps)
        after = min(before + 1, self.steps)
        return interpolate_pose(self.poses[before], self.poses[after], position - before)

    def forces_at(self, position: float) -> tuple[float, float, float, float]:
        """The forces that act at a position."""
        a, b, c, d = self.forces[min(int(position), self.steps)].tolist()
        return a, b, c, d


def read_track(path: Path | str) -> Track:
    """Reads and verifies a recording.

    Raises:
        FileFormatError: it cannot be read, is damaged, broke off, or is no recording of a task that is installed.
    """
    path = Path(path)
    if path.name.endswith(".part"):
        raise FileFormatError(path, "a finished recording", "one that broke off (copolicy-collect recover helps)")
    recording = read_recording(path)
    return track_of(path, recording.episode, _moments(recording))


def track_of(path: Path, episode: Episode, moments: tuple[Moment, ...] = ()) -> Track:
    """The track of an episode in memory."""
    task = get_task(episode.task)
    states = np.vstack((episode.states, episode.final_state))
    poses: tuple[Pose, ...] = ()
    forces = np.zeros((len(states), 4))
    if task.outline is not None:
        poses = tuple((x, y, theta) for x, y, theta in task.outline.poses(states).tolist())
        forces[:-1] = task.outline.forces(episode.actions)
    return Track(path, task, episode, poses, forces, task.interaction(states[1:], episode.actions), moments)


def _moments(recording: Recording) -> tuple[Moment, ...]:
    events = (event for event in recording.events if event.kind not in ("start", "end"))
    return tuple(Moment(event.step, event.kind, event.detail) for event in events)


def sampled(track: Track, frames_per_second: float, speed: float) -> list[float]:
    """Positions of the frames of a film of the whole track, steps; the last one is its end."""
    stride = track.hz * speed / frames_per_second
    positions = itertools.takewhile(lambda position: position < track.steps, itertools.count(0.0, stride))
    return [*positions, float(track.steps)]
