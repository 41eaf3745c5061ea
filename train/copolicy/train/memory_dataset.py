"""A LeRobot data set held in memory, which hands the data loader whole batches.

LeRobot's reader queries an Arrow table several times for each sample and torch collates hundreds of dicts for each
batch; for data without images that is thousands of times slower than indexing tensors. This data set takes its place
and yields the same batches: same keys in the same order, same values and dtypes, same padding.
"""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import torch
from lerobot.datasets import LeRobotDataset
from torch.utils.data import Dataset
from torch.utils.data._utils.collate import default_collate_fn_map

from copolicy.dataset.exceptions import RunError

from .frame_table import FrameTable, column_values, episode_bounds


class WindowBatch(dict[str, Any]):
    """A batch that is complete, and that torch's `default_collate` therefore passes on as it is."""


class DeferredBatch:
    """Which frames a batch is of; it becomes one where it is sent to a device, by gathering it there.

    Accelerate's loader sends whatever has a `to`, and torch's pinning of host memory leaves it alone; so of a batch
    for a GPU, whose data set lies there already, only the positions travel.
    """

    def __init__(self, dataset: "MemoryDataset", indices: Sequence[int]):
        self._dataset = dataset
        self._indices = indices

    def __len__(self) -> int:
        return len(self._indices)

    def to(self, device: torch.device | str, non_blocking: bool = False) -> WindowBatch:
        """The batch on a device."""
        return self._dataset.window_batch(self._indices, torch.device(device))


def _complete(batch: list[Any], *, collate_fn_map: dict | None = None) -> Any:
    return batch[0]


# torch documents this table as the way to teach `default_collate` a type; LeRobot's trainer has no place for a
# collate function of one's own.
default_collate_fn_map[WindowBatch] = _complete
default_collate_fn_map[DeferredBatch] = _complete


class MemoryDataset(Dataset):
    """The frames of a `LeRobotDataset` without images as tensors, and windows of them around each frame.

    Has the attributes that LeRobot's trainer reads from a data set. An index is a position among the selected
    episodes, as in `LeRobotDataset`. Videos are no part of it: nobody opens their files.
    """

    def __init__(self, dataset: LeRobotDataset, deferred: bool = False):
        """
        Args:
            dataset: what to hold.
            deferred: the loader gets a `DeferredBatch` for each batch, which is gathered where it is sent.

        Raises:
            RunError: the rows of an episode are not there, not in order, or hold empty values.
        """
        self.meta = dataset.meta
        self.episodes = dataset.episodes
        self.hf_dataset = dataset.hf_dataset
        self.absolute_to_relative_idx = dataset.absolute_to_relative_idx
        self.num_frames = dataset.num_frames
        self.num_episodes = dataset.num_episodes
        self.deferred = deferred
        table = self.hf_dataset.data
        columns = {
            name: column_values(name, table.column(name), self.meta.features[name]["shape"])
            for name in table.column_names
        }
        episodes = _present(self.meta.episodes)
        index, episode = np.asarray(columns["index"]), np.asarray(columns["episode_index"])
        starts, stops = (np.asarray(episodes[name]) for name in ("dataset_from_index", "dataset_to_index"))
        bounds = episode_bounds(index, episode, starts, stops, self.meta.root)
        host = torch.device("cpu")
        # LeRobot asks for a window of everything named observation.*, videos included, which are in files of their own.
        deltas = {key: value for key, value in (dataset.reader.delta_indices or {}).items() if key in columns}
        self._tables = {host: FrameTable(columns, bounds, deltas)}
        self._host = self._tables[host]
        tasks = [str(task) for task in _present(self.meta.tasks).index]
        self._task_of = [tasks[task] for task in np.asarray(columns["task_index"]).tolist()]

    @staticmethod
    def can_hold(dataset: Any, read: Collection[str] | None = None) -> bool:
        """Whether a data set is of the kind that fits: on disk, without images or language columns, and without
        videos that the policy looks at.

        Args:
            read: the observations that the policy reads; None where it may read any.
        """
        if not isinstance(dataset, LeRobotDataset) or dataset.meta.image_keys or dataset.meta.has_language_columns:
            return False
        videos = set(dataset.meta.video_keys)
        return not videos if read is None else videos.isdisjoint(read)

    def __len__(self) -> int:
        return self.num_frames

    def __getitem__(self, index: int) -> dict[str, Any]:
        return {key: values[0] for key, values in self.window_batch([index]).items()}

    def __getitems__(self, indices: Sequence[int]) -> list[WindowBatch | DeferredBatch]:
        """What torch's fetcher calls for a batch; one element, which is the batch."""
        return [DeferredBatch(self, indices) if self.deferred else self.window_batch(indices)]

    def window_batch(self, indices: Sequence[int], device: torch.device | None = None) -> WindowBatch:
        """The collated batch of some frames, see `FrameTable.batch`.

        Args:
            device: where it is gathered; all frames are copied there the first time.
        """
        table = self._host
        rows = torch.as_tensor(indices)
        if device is not None and device.type != "cpu":
            table = self._tables.get(device) or self._tables.setdefault(device, self._host.to(device))
            rows = rows.pin_memory().to(device, non_blocking=True) if device.type == "cuda" else rows.to(device)
        batch = WindowBatch(table.batch(rows, indices))
        batch["task"] = [self._task_of[index] for index in indices]
        return batch


def _present[T](table: T | None) -> T:
    """A table of the metadata, which LeRobot leaves out where the data set is empty."""
    if table is None:
        raise RunError("expected a data set with episodes, found an empty one")
    return table
