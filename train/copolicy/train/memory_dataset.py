"""A LeRobot data set in memory that gives the data loader whole batches.

LeRobot's reader queries an Arrow table several times for each sample and torch collates hundreds of dicts for each
batch; for data without images that is thousands of times slower than indexing tensors. This data set yields equal
batches: same keys in the same order, same values, dtypes and padding.
"""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import torch
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from torch.utils.data import Dataset
from torch.utils.data._utils.collate import default_collate_fn_map

from copolicy.dataset.exceptions import RunError

from .frame_tensors import FrameTensors, column_values, episode_bounds


class WindowBatch(dict[str, Any]):
    """A collated batch, which torch's `default_collate` returns unchanged."""


class DeferredBatch:
    """The positions of a batch's frames; `to` gathers the batch on a device.

    Accelerate's loader calls `to` on any object that has it, and torch does not pin its memory. So for a data set that
    is on the GPU, only the positions are copied there.
    """

    def __init__(self, dataset: "MemoryDataset", indices: Sequence[int]):
        self._dataset = dataset
        self._indices = indices

    def __len__(self) -> int:
        return len(self._indices)

    def to(self, device: torch.device | str, non_blocking: bool = False) -> WindowBatch:
        """The batch on a device."""
        return self._dataset.window_batch(self._indices, torch.device(device))


def _collate_complete(batch: list[Any], *, collate_fn_map: dict | None = None) -> Any:
    return batch[0]


# torch documents this dict as the extension point of `default_collate`; LeRobot's trainer has no parameter for a
# collate function.
default_collate_fn_map[WindowBatch] = _collate_complete
default_collate_fn_map[DeferredBatch] = _collate_complete


class MemoryDataset(Dataset[dict[str, Any]]):
    """The frames of a `LeRobotDataset` as tensors, with a window around each frame, without images and videos.

    Has the attributes that LeRobot's trainer reads from a data set. An index is a position among the frames of the
    selected episodes, as in `LeRobotDataset`. Video files are not opened.
    """

    def __init__(self, dataset: Any, deferred: bool = False):
        """
        Args:
            dataset: the `LeRobotDataset` to load (Any, because LeRobot's types are not exported).
            deferred: yield a `DeferredBatch` for each batch, which is gathered on the device that it is sent to.

        Raises:
            RunError: rows of an episode are missing or not in order, or a column has empty values.
        """
        self.meta: Any = dataset.meta
        self.episodes: list[int] | None = dataset.episodes
        self.hf_dataset: Any = dataset.hf_dataset
        self.absolute_to_relative_idx: dict[int, int] | None = dataset.absolute_to_relative_idx
        self.num_frames: int = dataset.num_frames
        self.num_episodes: int = dataset.num_episodes
        self.deferred: bool = deferred
        table = self.hf_dataset.data
        columns = {
            name: column_values(name, table.column(name), self.meta.features[name]["shape"])
            for name in table.column_names
        }
        episodes = _required_metadata(self.meta.episodes)
        index, episode = np.asarray(columns["index"]), np.asarray(columns["episode_index"])
        starts, stops = (np.asarray(episodes[name]) for name in ("dataset_from_index", "dataset_to_index"))
        bounds = episode_bounds(index, episode, starts, stops, self.meta.root)
        host = torch.device("cpu")
        # LeRobot requests windows of all observation.* columns, including videos, which are not in the frames' files.
        deltas = {key: value for key, value in (dataset.reader.delta_indices or {}).items() if key in columns}
        self._by_device = {host: FrameTensors(columns, bounds, deltas)}
        self._host = self._by_device[host]
        tasks = [str(task) for task in _required_metadata(self.meta.tasks).index]
        self._task_of = [tasks[task] for task in np.asarray(columns["task_index"]).tolist()]

    @staticmethod
    def supports(dataset: Any, observation_keys: Collection[str] | None = None) -> bool:
        """Whether a data set is on disk, without images and language columns, and without videos that are observed.

        Args:
            observation_keys: columns that the policy reads; None if it may observation_keys any.
        """
        if not isinstance(dataset, LeRobotDataset) or dataset.meta.image_keys or dataset.meta.has_language_columns:
            return False
        videos = set(dataset.meta.video_keys)
        return not videos if observation_keys is None else videos.isdisjoint(observation_keys)

    @property
    def frames(self) -> FrameTensors:
        """All frames, on the host."""
        return self._host

    def __len__(self) -> int:
        return self.num_frames

    def __getitem__(self, index: int) -> dict[str, Any]:
        return {key: values[0] for key, values in self.window_batch([index]).items()}

    def __getitems__(self, indices: Sequence[int]) -> list[WindowBatch | DeferredBatch]:
        """Called by torch's fetcher; returns a list whose only element is the batch."""
        return [DeferredBatch(self, indices) if self.deferred else self.window_batch(indices)]

    def window_batch(self, indices: Sequence[int], device: torch.device | None = None) -> WindowBatch:
        """The collated batch of the given frames, see `FrameTensors.batch`.

        Args:
            device: device to gather on; all frames are copied there on first use.
        """
        frames = self._host
        rows = torch.as_tensor(indices)
        if device is not None and device.type != "cpu":
            frames = self._by_device.get(device) or self._by_device.setdefault(device, self._host.to(device))
            rows = rows.pin_memory().to(device, non_blocking=True) if device.type == "cuda" else rows.to(device)
        batch = WindowBatch(frames.batch(rows, indices))
        batch["task"] = [self._task_of[index] for index in indices]
        return batch


def _required_metadata[T](metadata: T | None) -> T:
    """Part of the metadata, which is None in LeRobot if the data set is empty."""
    if metadata is None:
        raise RunError("expected a data set with episodes, found an empty one")
    return metadata
