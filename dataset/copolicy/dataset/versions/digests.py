"""What two data sets are compared by: a digest of each episode, feature and episode column. Plain data."""

from dataclasses import asdict, dataclass
from typing import Any, TypedDict

from .canonical import digest

FORMAT = "copolicy-content-1"
"""Version of the algorithm; another one gives another prefix."""


@dataclass(frozen=True)
class EpisodeContent:
    """One episode.

    Attributes:
        digest: sha256 over everything in it.
        frames: its length.
        features: digest of each feature's values, shortened.
        columns: digest of each episode column, shortened.
    """

    episode_uuid: str
    digest: str
    frames: int
    features: dict[str, str]
    columns: dict[str, str]


class EpisodeFields(TypedDict):
    """An `EpisodeContent` in JSON."""

    episode_uuid: str
    digest: str
    frames: int
    features: dict[str, str]
    columns: dict[str, str]


class ContentFields(TypedDict):
    """A `Content` in JSON."""

    fps: float | int
    robot_type: str | None
    features: dict[str, Any]
    tasks: list[str]
    episodes: list[EpisodeFields]


@dataclass(frozen=True)
class Content:
    """Everything that two data sets are compared by."""

    fps: float
    robot_type: str | None
    features: dict[str, Any]
    tasks: list[str]
    episodes: tuple[EpisodeContent, ...]

    @property
    def hash(self) -> str:
        """The content hash with its prefix."""
        fields = {
            "format": FORMAT,
            "fps": float(self.fps),
            "robot_type": self.robot_type,
            "features": self.features,
            "tasks": self.tasks,
            "episodes": [episode.digest for episode in self.episodes],
        }
        return f"{FORMAT}:sha256:{digest(fields)}"

    def to_json(self) -> dict[str, Any]:
        """For the record of a release."""
        return asdict(self)

    @classmethod
    def from_json(cls, fields: ContentFields) -> "Content":
        """The inverse of `to_json`."""
        episodes = tuple(
            EpisodeContent(
                episode["episode_uuid"], episode["digest"], episode["frames"], episode["features"], episode["columns"]
            )
            for episode in fields["episodes"]
        )
        return cls(fields["fps"], fields["robot_type"], fields["features"], fields["tasks"], episodes)
