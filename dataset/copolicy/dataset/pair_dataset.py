"""A data set for notebooks and scripts: episodes as arrays, and a table with one row per episode."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, overload

from .arrays import Array
from .exceptions import CopolicyError, FileFormatError
from .features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE, features_of
from .hub.local_copy import local_copy
from .lerobot_folder.folder import POSITIONS, LeRobotFolder
from .lerobot_folder.tables import pa
from .settings_text import parse_settings_text
from .task import PairTask

_REWARD = "next.reward"


def load_dataset(path: str | Path, revision: str | None = None) -> "PairDataset":
    """Opens a LeRobot v3 data set in a folder or on the Hub (downloads everything except the recordings).

    Args:
        path: a folder, `USER/NAME`, or `hf://datasets/USER/NAME`.
        revision: tag, branch or commit on the Hub; `main` if None.

    Raises:
        FileFormatError: the folder does not exist or is not a LeRobot v3 data set of an installed task.
        InvalidValueError: `revision` is given for a folder.
        HubError: the Hub does not answer, or has no such data set or revision.
    """
    folder = LeRobotFolder.open(local_copy(str(path), revision))
    folder.require_task((STATE, ACTION, ENVIRONMENT_STATE))
    return PairDataset(folder)


@dataclass(frozen=True, repr=False)
class DatasetEpisode:
    """One episode at the rate of its data set.

    A type of its own beside `Episode`: a data set does not store the state after the last action, and has columns that
    recordings lack.

    Attributes:
        index: `episode_index`.
        columns: episode columns by name, see `EpisodeMeta`.
        states: `(T, n)`, see `TaskSpec.state`.
        actions: `(T, 2 m)`, see `TaskSpec.joint_action`: robot, human.
        past_human_actions: `(T, m)` the human's action of the previous frame, zero at the first.
        rewards: `(T,)` reward of the state after each frame.
        fps: frames per second.
    """

    index: int
    columns: Mapping[str, Any]
    states: Array
    actions: Array
    past_human_actions: Array
    rewards: Array
    fps: int
    task: PairTask
    scenario: Any

    def __len__(self) -> int:
        return len(self.states)

    def __repr__(self) -> str:
        row = self.columns
        return (
            f"DatasetEpisode({self.index}, states={self.states.shape}, actions={self.actions.shape}, "
            f"map={row['map_id']}, source={row['source']}, {row['termination_reason']})"
        )

    @property
    def settings(self) -> Any:
        """Settings of the simulated world; None if the data set does not state them."""
        return parse_settings_text(self.columns["physics"], self.task)

    @property
    def path(self) -> Array | None:
        """`(T, 2)` positions of the tracked point; None if the task tracks none."""
        return self.task.path(self.states)

    @property
    def interaction(self) -> Array | None:
        """`(T,)` interaction measure, see `PairTask.interaction`; None if the task has none."""
        return self.task.interaction(self.states, self.actions)


class PairDataset:
    """A LeRobot v3 data set of a pair task.

    Attributes:
        root: folder of the data set.
        info: content of `meta/info.json`.
        task: task of the episodes.
        fps: frames per second.
        episodes: a sequence of `DatasetEpisode`. Iterating reads one data file at a time, indexing loads all of them.
    """

    def __init__(self, folder: LeRobotFolder):
        self._folder = folder
        self.root: Path = folder.root
        self.info: dict[str, Any] = folder.info
        self.task: PairTask = folder.task
        self.fps: int = int(folder.info["fps"])
        self.episodes: Episodes = Episodes(folder, self.fps)

    def __len__(self) -> int:
        return len(self.episodes)

    def __repr__(self) -> str:
        sources = sorted({row["source"] for row in self._folder.rows(("source",))})
        frames = sum(self._folder.lengths)
        return (
            f"PairDataset({self.root.name}: {len(self)} episodes of {self.task.spec.title}, {frames} frames at "
            f"{self.fps} Hz, source: {', '.join(sources)})"
        )

    @property
    def splits(self) -> dict[str, range]:
        """Episode indices of each split."""
        return self._folder.splits

    @cached_property
    def table(self) -> pa.Table:
        """One row per episode: `episode_index`, `length` and the episode columns. `.to_pandas()` needs pandas."""
        keys = [name for name in self._folder.episodes.column_names if "/" not in name and name not in POSITIONS[2:]]
        return self._folder.episodes.select(keys)


class Episodes(Sequence[DatasetEpisode]):
    """The episodes of a data set, in order."""

    def __init__(self, folder: LeRobotFolder, fps: int):
        self._folder, self._fps = folder, fps
        self._rows = folder.rows()
        features = features_of(folder.task.spec)
        self._shapes = {name: features[name]["shape"] for name in (STATE, ENVIRONMENT_STATE, HUMAN_ACTION, ACTION)}
        self._shapes[_REWARD] = (1,)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[DatasetEpisode]:
        if "_loaded" in self.__dict__:
            yield from self._loaded
            return
        for index, columns in self._folder.frames(self._shapes):
            yield self._episode(index, columns)

    @overload
    def __getitem__(self, index: int) -> DatasetEpisode: ...
    @overload
    def __getitem__(self, index: slice) -> list[DatasetEpisode]: ...
    def __getitem__(self, index: int | slice) -> DatasetEpisode | list[DatasetEpisode]:
        return self._loaded[index]

    def __repr__(self) -> str:
        return f"Episodes({len(self)} of {self._folder.root.name})"

    @cached_property
    def _loaded(self) -> list[DatasetEpisode]:
        return [self._episode(index, columns) for index, columns in self._folder.frames(self._shapes)]

    def _episode(self, index: int, columns: Mapping[str, Array]) -> DatasetEpisode:
        row, task = self._rows[index], self._folder.task
        try:
            scenario = task.scenario_of_vector(columns[ENVIRONMENT_STATE][0].astype(float), row)
        except CopolicyError as error:
            raise FileFormatError(self._folder.root / "data", f"a scenario in episode {index}", str(error)) from None
        return DatasetEpisode(
            index, row, columns[STATE], columns[ACTION], columns[HUMAN_ACTION], columns[_REWARD].reshape(-1),
            self._fps, task, scenario,
        )  # fmt: skip
