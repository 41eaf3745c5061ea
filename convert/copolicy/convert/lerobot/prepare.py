"""Everything about an episode that can be worked out without knowing its place in the data set, and whether it
belongs into one."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from copolicy.dataset.clock import Downsampling
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.features import STATE
from copolicy.dataset.task import get_task

from ..column_statistics import episode_statistics
from .frames import frame_columns

if TYPE_CHECKING:
    from ..video.scene_video import SceneClip


@dataclass(frozen=True)
class Conversion:
    """How episodes become frames.

    Attributes:
        fps: frames a second, a divisor of 30.
        hold: how the actions of a frame's steps become one.
        license: filled in where an episode states none.
        keep_discarded: keep episodes that the operator discarded.
        drift: re-simulate each episode that does not say how far its replay drifts.
        video: width and height (px) of the pictures to draw of each frame; None for no video.
    """

    fps: int = 10
    hold: Downsampling = "mean"
    license: str = ""
    keep_discarded: bool = False
    drift: bool = True
    video: tuple[int, int] | None = None


@dataclass(frozen=True)
class PreparedEpisode:
    """Frames, their statistics, the row of meta/episodes, and the film if one was asked for.

    Attributes:
        origin: the file that the episode was read from, for messages; no part of the data set.
        task: name of its task.
    """

    columns: dict[str, np.ndarray]
    statistics: dict[str, dict[str, np.ndarray]]
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
class NotPrepared:
    """An episode that stays outside, by the name of its file."""

    name: str
    reason: Literal["damaged", "discarded"]
    message: str = ""


@dataclass
class LeftOut:
    """Names of the episodes that are not in a data set, and what is wrong with the damaged ones."""

    damaged: list[str] = field(default_factory=list)
    discarded: list[str] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)

    def record(self) -> dict[str, list[str]]:
        """The names alone: messages hold paths of the machine."""
        return {"damaged": self.damaged, "discarded": self.discarded}


class RepeatedEpisodeError(RunError):
    """Two files hold one episode."""

    def __init__(self, episode_uuid: str, first: str, second: str):
        same = "twice there" if first == second else f"also in {first}"
        super().__init__(
            f"{second}: expected every episode once, found episode {episode_uuid} {same}; nothing was written"
        )


class DamagedEpisodeError(RunError):
    """A file that holds no usable episode, where none may be left out."""

    def __init__(self, message: str):
        super().__init__(f"{message}; nothing was written (--skip-damaged leaves such files out)")


def prepare_episode(episode: Episode, conversion: Conversion) -> PreparedEpisode:
    """Frames with their statistics, and the episode's columns completed.

    Raises:
        InvalidValueError: the episode cannot be had at this rate (see `frame_columns`).
        MissingExtraError: a video is asked for and lerobot is not installed.
    """
    columns = frame_columns(episode, conversion.fps, conversion.hold)
    meta = episode.meta
    if not meta.license:
        meta = replace(meta, license=conversion.license)
    if conversion.drift and np.isnan(meta.replay_drift_px):
        meta = replace(meta, replay_drift_px=replay_drift(episode))
    statistics = episode_statistics(columns)
    if conversion.video is None:
        return PreparedEpisode(columns, statistics, meta, episode.notes, task=episode.task)

    # They load what a conversion without a video never needs.
    from ..video.scene_video import SCENE, scene_clip

    task = get_task(episode.task)
    images = task.images(episode.scenario, columns[STATE], conversion.video)
    if images is None:
        raise InvalidValueError("--video", "a task that is drawn", task.missing("artist"))
    clip = scene_clip(images, conversion.fps, conversion.video)
    statistics = {**statistics, SCENE: clip.statistics}
    return PreparedEpisode(columns, statistics, meta, episode.notes, clip, task=episode.task)


def replay_drift(episode: Episode) -> float:
    """Largest distance between the path recorded and the one that the actions give from the first state on; of the
    table in px.

    NaN where not every recorded action was stored, or the task tracks no point.
    """
    task, path = get_task(episode.task), episode.path
    if path is None or episode.fps != task.spec.record_hz or not len(episode.actions):
        return float("nan")
    replayed = task.path(task.integrate(episode.scenario, episode.settings, episode.states[0], episode.actions))
    return float(np.linalg.norm(replayed - path, axis=1).max())


def prepare_from(
    name: str, read: Callable[[], Episode], conversion: Conversion, origin: str | None = None
) -> PreparedEpisode | NotPrepared:
    """Reads and prepares an episode; a damaged or discarded one is reported, not raised, so that the result can
    cross from one process to another.

    Args:
        origin: path of the file, where `name` alone does not tell two files apart.
    """
    try:
        episode = read()
        if episode.meta.discarded and not conversion.keep_discarded:
            return NotPrepared(name, "discarded")
        return replace(prepare_episode(episode, conversion), origin=origin or name)
    except CopolicyError as error:
        return NotPrepared(name, "damaged", str(error))


def admit(
    results: Iterable[PreparedEpisode | NotPrepared], skip_damaged: bool, left_out: LeftOut
) -> Iterator[PreparedEpisode]:
    """The prepared episodes; the others are noted in `left_out`.

    Raises:
        DamagedEpisodeError: an episode is damaged and `skip_damaged` is off.
    """
    for result in results:
        if isinstance(result, PreparedEpisode):
            yield result
        elif result.reason == "discarded":
            left_out.discarded.append(result.name)
        elif skip_damaged:
            left_out.damaged.append(result.name)
            left_out.messages.append(result.message)
        else:
            raise DamagedEpisodeError(result.message)
