"""A LeRobot data set held in memory, which hands the data loader whole batches.

LeRobot's reader queries an Arrow table several times for each sample and torch collates hundreds of dicts for each
batch; for data without images that is thousands of times slower than indexing tensors. This data set takes its place
and yields the same batches: same keys in the same order, same values and dtypes, same padding.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import torch
from lerobot.datasets import LeRobotDataset
from torch import Tensor
from torch.utils.data import Dataset
from torch.utils.data._utils.collate import default_collate_fn_map

from copolicy.dataset.exceptions import RunError


class WindowBatch(dict[str, Any]):
    """A batch that is complete, and that torch's `default_collate` therefore passes on as it is."""


def _complete(batch: list[WindowBatch], *, collate_fn_map: dict | None = None) -> WindowBatch:
    return batch[0]


# torch documents this table as the way to teach `default_collate` a type; LeRobot's trainer has no place for a
# collate function of one's own.
default_collate_fn_map[WindowBatch] = _complete


class MemoryDataset(Dataset):
    """The frames of a `LeRobotDataset` without images as tensors, and windows of them around each frame.

    Has the attributes that LeRobot's trainer reads from a data set. An index is a position among the selected
    episodes, as in `LeRobotDataset`.

    Raises:
        RunError: the rows of an episode are not there, not in order, or hold empty values.
    """

    def __init__(self, dataset: LeRobotDataset):
        reader = dataset.reader
        self.meta = dataset.meta
        self.episodes = dataset.episodes
        self.hf_dataset = dataset.hf_dataset
        self.absolute_to_relative_idx = dataset.absolute_to_relative_idx
        self.num_frames = dataset.num_frames
        self.num_episodes = dataset.num_episodes
        self._delta_indices: dict[str, list[int]] = reader.delta_indices or {}
        table = self.hf_dataset.data
        self._columns: dict[str, Any] = {
            name: _column(name, table.column(name), self.meta.features) for name in table.column_names
        }
        self._tasks = [str(task) for task in _present(self.meta.tasks).index]
        self._first, self._last = self._episode_bounds()

    @staticmethod
    def can_hold(dataset: Any) -> bool:
        """Whether a data set is of the kind that fits: on disk, without images, videos or language columns."""
        return (
            isinstance(dataset, LeRobotDataset)
            and not dataset.meta.camera_keys
            and not dataset.meta.has_language_columns
        )

    def __len__(self) -> int:
        return self.num_frames

    def __getitem__(self, index: int) -> dict[str, Any]:
        return {key: values[0] for key, values in self.window_batch([index]).items()}

    def __getitems__(self, indices: Sequence[int]) -> list[WindowBatch]:
        """What torch's fetcher calls for a batch; one element, which is the batch."""
        return [self.window_batch(indices)]

    def window_batch(self, indices: Sequence[int]) -> WindowBatch:
        """The collated batch of some frames.

        Returns:
            A column with windows is `(B, window, n)` and has a mask `KEY_is_pad` `(B, window)`, true where the window
            leaves the episode and repeats its first or last frame; any other column is `(B, n)`, or `(B,)` for n = 1.
        """
        rows = torch.as_tensor(indices)
        windows: dict[tuple[int, ...], tuple[Tensor, Tensor]] = {}
        for deltas in map(tuple, self._delta_indices.values()):
            if deltas not in windows:
                windows[deltas] = self._window(rows, deltas)
        batch = WindowBatch()
        for key, values in self._columns.items():
            positions = windows[tuple(self._delta_indices[key])][0] if key in self._delta_indices else rows
            batch[key] = values[positions] if isinstance(values, Tensor) else [values[row] for row in indices]
        for key, deltas in self._delta_indices.items():
            # A copy for each key, since what LeRobot collates shares nothing either.
            batch[f"{key}_is_pad"] = windows[tuple(deltas)][1].clone()
        batch["task"] = [self._tasks[task] for task in batch["task_index"].tolist()]
        return batch

    def _window(self, rows: Tensor, deltas: tuple[int, ...]) -> tuple[Tensor, Tensor]:
        wanted = rows[:, None] + torch.tensor(deltas)  # (B, window)
        first, last = self._first[rows, None], self._last[rows, None]
        return wanted.clamp(first, last), (wanted < first) | (wanted > last)

    def _episode_bounds(self) -> tuple[Tensor, Tensor]:
        """Positions of the first and the last frame of each frame's episode, `(frames,)` each."""
        index, episode = self._columns["index"].numpy(), self._columns["episode_index"].numpy()
        episodes = _present(self.meta.episodes)
        starts, stops = (np.asarray(episodes[column]) for column in ("dataset_from_index", "dataset_to_index"))
        broken = np.flatnonzero(episode >= len(starts))
        if not len(broken):
            position = np.arange(len(index))
            first = position - (index - starts[episode])
            last = position + (stops[episode] - 1 - index)
            inside = (first >= 0) & (last < len(index)) & (first <= position) & (position <= last)
            at_first, at_last = first.clip(0, len(index) - 1), last.clip(0, len(index) - 1)
            ordered = (index[at_first] == starts[episode]) & (index[at_last] == stops[episode] - 1)
            broken = np.flatnonzero(~(inside & ordered))
            if not len(broken):
                return torch.from_numpy(first), torch.from_numpy(last)
        raise RunError(
            f"{self.meta.root}: expected the rows of each episode together and in order, as meta/episodes says, "
            f"found otherwise in episode {episode[broken[0]]}"
        )


def _present[T](table: T | None) -> T:
    """A table of the metadata, which LeRobot leaves out where the data set is empty."""
    if table is None:
        raise RunError("expected a data set with episodes, found an empty one")
    return table


def _column(name: str, column: pa.ChunkedArray, features: dict[str, dict]) -> Tensor | list[str]:
    """A column with the dtypes that LeRobot's own reader gives: float32, int64, bool, or texts."""
    array = column.combine_chunks()
    if isinstance(array, pa.ExtensionArray):
        array = array.storage
    if pa.types.is_string(array.type) or pa.types.is_large_string(array.type):
        return array.to_pylist()
    empty = array.null_count
    while pa.types.is_nested(array.type):
        array = array.flatten()
        empty += array.null_count
    if empty:
        raise RunError(f"{name}: expected a value in every row, found {empty} empty ones")
    values = array.to_numpy(zero_copy_only=False)
    if values.dtype.kind == "f":
        values = values.astype(np.float32)
    elif values.dtype.kind in "iu":
        values = values.astype(np.int64)
    shape = tuple(features[name]["shape"])
    return torch.from_numpy(values.reshape(len(column), *(() if shape == (1,) else shape)).copy())
