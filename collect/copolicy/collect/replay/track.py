"""A recording as what can be shown of it at any moment."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.outline import Pose, between
from copolicy.dataset.recording.log import Recording, read_recording
from copolicy.dataset.task import get_task, require_table
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.features import theta_of
from copolicy.tasks.table.interaction import interaction_force


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
        episode: states, actions, metadata, map.
        poses: `T + 1`, px and rad.
        forces: `(T + 1, 4)` robot xy, human xy; none at the end.
        interaction: `(T,)` interaction force of each step, units of a player's full force; positive pulls apart.
        moments: what happened, in order, without start and end.
    """

    path: Path
    episode: Episode
    poses: tuple[Pose, ...]
    forces: np.ndarray
    interaction: np.ndarray
    moments: tuple[Moment, ...] = ()

    @property
    def steps(self) -> int:
        """T, and the position of the last state."""
        return len(self.interaction)

    @property
    def seconds(self) -> float:
        """Length in simulated time."""
        return self.steps / RECORD_HZ

    def pose_at(self, position: float) -> Pose:
        """The pose at a position between 0 and T, steps; between two states a way between them."""
        before = min(int(position), self.steps)
        after = min(before + 1, self.steps)
        return between(self.poses[before], self.poses[after], position - before)

    def forces_at(self, position: float) -> tuple[float, float, float, float]:
        """The forces that act at a position."""
        a, b, c, d = self.forces[min(int(position), self.steps)].tolist()
        return a, b, c, d

    def interaction_at(self, position: float) -> float:
        """The interaction force at a position; the last one at the end."""
        return float(self.interaction[min(int(position), self.steps - 1)]) if self.steps else 0.0


def read_track(path: Path | str) -> Track:
    """Reads and verifies a recording.

    Raises:
        FileFormatError: it cannot be read, is damaged, broke off, or is no recording of this task.
    """
    path = Path(path)
    if path.name.endswith(".part"):
        raise FileFormatError(path, "a finished recording", "one that broke off (copolicy-collect recover helps)")
    recording = read_recording(path)
    return track_of(path, recording.episode, _moments(recording))


def track_of(path: Path, episode: Episode, moments: tuple[Moment, ...] = ()) -> Track:
    """The track of an episode in memory.

    Raises:
        FileFormatError: it is of another task than the table.
    """
    require_table(get_task(episode.task), path)
    states = np.vstack((episode.states, episode.final_state))
    theta = theta_of(states)
    poses = tuple((x, y, angle) for (x, y), angle in zip(states[:, :2].tolist(), theta.tolist(), strict=True))
    forces = np.vstack((episode.actions, np.zeros(4)))
    return Track(path, episode, poses, forces, interaction_force(theta[1:], episode.actions), moments)


def _moments(recording: Recording) -> tuple[Moment, ...]:
    events = (event for event in recording.events if event.kind not in ("start", "end"))
    return tuple(Moment(event.step, event.kind, event.detail) for event in events)


def sampled(track: Track, frames_per_second: float, speed: float) -> list[float]:
    """Positions of the frames of a film of the whole track, steps; the last one is its end."""
    stride = RECORD_HZ * speed / frames_per_second
    positions = itertools.takewhile(lambda position: position < track.steps, itertools.count(0.0, stride))
    return [*positions, float(track.steps)]
