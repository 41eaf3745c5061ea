"""Prepares episodes for a data set: everything that does not depend on their position in it."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.clock import Downsampling
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.features import STATE
from copolicy.dataset.task import get_task

from ..column_statistics import episode_statistics
from .frame_columns import frame_columns

if TYPE_CHECKING:
    from ..video.scene_video import SceneClip


@dataclass(frozen=True)
class Conversion:
    """Options of the conversion from recorded steps to frames.

    Attributes:
        fps: frames per second, a divisor of the recording rate.
        downsampling: how the actions of a frame's steps become one.
        license: licence of episodes that state none.
        keep_discarded: keep episodes that the operator discarded.
        drift: compute `replay_drift_px` by re-simulation where an episode does not state it.
        video: width and height (px) of the images drawn of each frame; None for no video.

    Raises:
        InvalidValueError: another downsampling than `mean` or `first`.
    """

    fps: int = 10
    downsampling: Downsampling = "mean"
    license: str = ""
    keep_discarded: bool = False
    drift: bool = True
    video: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        if self.downsampling not in get_args(Downsampling):
            raise InvalidValueError("downsampling", " or ".join(get_args(Downsampling)), self.downsampling)


@dataclass(frozen=True)
class PreparedEpisode:
    """An episode ready to be written: frames, their statistics, episode columns, and its video if requested.

    Attributes:
        origin: the file that the episode was read from, for messages; not written.
        task: name of its task.
    """

    columns: dict[str, Array]
    statistics: dict[str, dict[str, Array]]
    meta: EpisodeMeta
    notes: tuple[str, ...] = ()
    scene: "SceneClip | None" = None
    origin: str = ""
    task: str = "table"

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.columns["next.done"])


@dataclass(frozen=True)
class SkippedEpisode:
    """An episode that is not written, by the name of its file."""

    name: str
    reason: Literal["damaged", "discarded"]
    message: str = ""


@dataclass
class SkipReport:
    """Names of the skipped episodes, and the error messages of the damaged ones."""

    damaged: list[str] = field(default_factory=list)
    discarded: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)

    def record(self) -> dict[str, list[str]]:
        """The names without the messages, which hold local paths."""
        return {"damaged": self.damaged, "discarded": self.discarded}


class RepeatedEpisodeError(RunError):
    """Two files hold the same episode."""

    def __init__(self, episode_uuid: str, first: str, second: str):
        repetition = "twice" if first == second else f"also in {first}"
        super().__init__(
            f"{second}: expected every episode once, found episode {episode_uuid} {repetition}; nothing was written"
        )


class DamagedEpisodeError(RunError):
    """A file holds no usable episode, and `skip_damaged` is off."""

    def __init__(self, message: str):
        super().__init__(f"{message}; nothing was written (--skip-damaged skips such files)")


def prepare_episode(episode: Episode, conversion: Conversion) -> PreparedEpisode:
    """Computes the frames of an episode, their statistics and the missing episode columns.

    Raises:
        InvalidValueError: the episode cannot be converted to this rate (see `frame_columns`).
        MissingExtraError: a video is requested and lerobot is not installed.
    """
    columns = frame_columns(episode, conversion.fps, conversion.downsampling)
    meta = episode.meta
    if not meta.license:
        meta = replace(meta, license=conversion.license)
    if conversion.drift and np.isnan(meta.replay_drift_px):
        meta = replace(meta, replay_drift_px=replay_drift(episode))
    statistics = episode_statistics(columns)
    if conversion.video is None:
        return PreparedEpisode(columns, statistics, meta, episode.notes, task=episode.task)

    # Imported here: a conversion without video does not need PyAV.
    from ..video.scene_video import SCENE, scene_clip

    task = get_task(episode.task)
    images = task.images(episode.scenario, columns[STATE], conversion.video)
    if images is None:
        raise InvalidValueError("--video", "a task with an artist", task.missing("artist"))
    clip = scene_clip(images, conversion.fps, conversion.video)
    statistics = {**statistics, SCENE: clip.statistics}
    return PreparedEpisode(columns, statistics, meta, episode.notes, clip, task=episode.task)


def replay_drift(episode: Episode) -> float:
    """Largest distance between the recorded path and the path simulated from the first state with the actions.

    In the task's unit of length (table: px). NaN if not every recorded action was stored, or the task tracks no point.
    """
    task, path = get_task(episode.task), episode.path
    if path is None or episode.fps != task.spec.record_hz or not len(episode.actions):
        return float("nan")
    replayed = task.path(task.integrate(episode.scenario, episode.settings, episode.states[0], episode.actions))
    return float(np.linalg.norm(replayed - path, axis=1).max())


def read_and_prepare(
    name: str, read: Callable[[], Episode], conversion: Conversion, origin: str | None = None
) -> PreparedEpisode | SkippedEpisode:
    """Reads and prepares an episode; returns a damaged or discarded one as `SkippedEpisode` instead of raising.

    Args:
        origin: path of the file, where `name` alone is ambiguous.
    """
    try:
        episode = read()
        if episode.meta.discarded and not conversion.keep_discarded:
            return SkippedEpisode(name, "discarded")
        return replace(prepare_episode(episode, conversion), origin=origin or name)
    except CopolicyError as error:
        return SkippedEpisode(name, "damaged", str(error))


def admit(
    results: Iterable[PreparedEpisode | SkippedEpisode], skip_damaged: bool, skipped: SkipReport
) -> Iterator[PreparedEpisode]:
    """Yields the prepared episodes and adds the skipped ones to `skipped`.

    Raises:
        DamagedEpisodeError: an episode is damaged and `skip_damaged` is off.
    """
    for result in results:
        if isinstance(result, PreparedEpisode):
            yield result
        elif result.reason == "discarded":
            skipped.discarded.append(result.name)
        elif skip_damaged:
            skipped.damaged.append(result.name)
            skipped.messages.append(result.message)
        else:
            raise DamagedEpisodeError(result.message)
