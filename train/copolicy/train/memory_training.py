"""LeRobot's own trainer, fed from memory with episodes and numbers that can be trained on."""

import logging
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np
import torch
from lerobot.configs.train import TrainPipelineConfig
from lerobot.datasets import EpisodeAwareSampler, LeRobotDatasetMetadata, dataset_reader, io_utils
from lerobot.datasets import factory as lerobot_datasets
from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset
from lerobot.scripts import lerobot_train
from tqdm import tqdm

from copolicy.dataset.files.listing import skipping_hidden_files

from .episode_choice import chosen_episodes, recorded_episodes, resumed_episodes
from .finite_data import NonFiniteError, mended_statistics, require_finite_frames
from .finite_training import guarded
from .memory_dataset import MemoryDataset

_GUARDED = ("update_policy", "save_checkpoint", "update_last_checkpoint", "make_policy")


def train_from_memory(config: TrainPipelineConfig) -> None:
    """Runs `lerobot_train.train` with data sets in memory; checkpoints, logs and evaluation are LeRobot's.

    Raises:
        CopolicyError: the data set cannot be trained on, or the training leads nowhere.
    """
    guards = guarded(config, {name: getattr(lerobot_train, name) for name in _GUARDED})
    with _datasets_in_memory(), _hidden_files_passed_over(), _replaced(lerobot_train, guards):
        try:
            lerobot_train.train(config)
        finally:
            # LeRobot's own is drawn once more when Python forgets it, which would be after the line of an error.
            for bar in list(getattr(tqdm, "_instances", ())):
                bar.close()


@contextmanager
def _datasets_in_memory() -> Iterator[None]:
    # LeRobot's trainer takes no data set or sampler of one's own; it looks these names up in its module at each run.
    original = lerobot_train.make_train_eval_datasets
    ours = {
        "make_train_eval_datasets": lambda config: _make_datasets(config, original),
        "EpisodeAwareSampler": WholeEpochSampler,
    }
    with _replaced(lerobot_datasets, {"StreamingLeRobotDataset": CheckedStream}), _replaced(lerobot_train, ours):
        yield


@contextmanager
def _replaced(module: ModuleType, values: Mapping[str, Any]) -> Iterator[None]:
    before = {name: getattr(module, name) for name in values}
    for name, value in values.items():
        setattr(module, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(module, name, value)


@contextmanager
def _hidden_files_passed_over() -> Iterator[None]:
    # LeRobot takes every file in a folder of tables for one, also what macOS leaves beside them.
    ours = {"load_nested_dataset": skipping_hidden_files(io_utils.load_nested_dataset)}
    with _replaced(io_utils, ours), _replaced(dataset_reader, ours):
        yield


def _make_datasets(config: TrainPipelineConfig, original: Callable) -> tuple:
    # The co-policy says what it reads; any other policy takes what it finds.
    read = getattr(config.policy, "observation_keys", None)
    on_host = config.trainable_config.device == "cpu"
    return tuple(
        None if dataset is None else _in_memory(dataset, read, deferred=not on_host)
        for dataset in _load(config, original)
    )


def _load(config: TrainPipelineConfig, original: Callable) -> tuple:
    """LeRobot's data sets of the episodes to train on, which the configuration and so each checkpoint then names."""
    source = config.dataset
    repo_type = "bucket" if source.repo_type == "bucket" else "dataset"
    meta = LeRobotDatasetMetadata(source.repo_id, source.root, source.revision, repo_type=repo_type)
    if config.resume and config.checkpoint_path is not None:
        episodes = resumed_episodes(meta, source.episodes, recorded_episodes(config.checkpoint_path))
    else:
        episodes = chosen_episodes(meta, source.episodes)
    whole = episodes == list(range(meta.total_episodes))
    statistics = mended_statistics(meta.root, meta.stats, episodes, meta.total_episodes)
    local = source.root is not None
    if local:
        require_finite_frames(meta.root, episodes, meta.features)
    source.episodes = None if whole else episodes  # LeRobot reads all of them sooner than each of them
    try:
        datasets = original(config)
    finally:
        source.episodes = episodes
    for dataset in datasets:
        if dataset is not None:
            if dataset.episodes is None:
                dataset.episodes = episodes
            if statistics:
                dataset.meta.stats.update(statistics)
            if not local:  # by now they are here
                require_finite_frames(dataset.meta.root, episodes, meta.features)
    return datasets


def _in_memory(dataset, read: Collection[str] | None, deferred: bool):
    if MemoryDataset.can_hold(dataset, read):
        if dataset.meta.video_keys:
            logging.info("The policy does not look at %s: no video is decoded", ", ".join(dataset.meta.video_keys))
        return MemoryDataset(dataset, deferred)
    logging.warning(
        "The policy may look at images of the data set, or it is streamed: frames come through LeRobot's own loader"
    )
    return dataset


class WholeEpochSampler(EpisodeAwareSampler):
    """LeRobot's sampler in the same order, computed for the whole epoch at its start.

    LeRobot finds the frame of each position on its own, which at 2.6 us a sample costs more than everything else of
    loading from memory. At once it is 0.08 us, for a list of the frames in memory.
    """

    def _iter_epoch(self, epoch: int, start: int) -> Iterator[int]:
        if self.shuffle:
            order = torch.randperm(self._num_frames, generator=self._epoch_generator(epoch)).numpy()
        else:
            order = np.arange(self._num_frames)
        positions = order[start:]
        episodes = np.searchsorted(self._cum_lengths, positions, side="right")
        frames_before = np.concatenate(([0], self._cum_lengths[:-1]))
        frames = (self._starts[episodes] + positions - frames_before[episodes]).tolist()
        if self._absolute_to_relative is not None:
            frames = [self._absolute_to_relative[frame] for frame in frames]
        return iter(frames)


class CheckedStream(StreamingLeRobotDataset):
    """Passes over episodes that were not asked for, which LeRobot's own yields all the same.

    Raises:
        NonFiniteError: while it is read, at a sample with a value that is NaN or infinite.
    """

    def __init__(self, *arguments: Any, max_num_shards: int = 1, **settings: Any):
        # LeRobot passes the number of loading processes, which is 0 here, and then reads nothing.
        super().__init__(*arguments, max_num_shards=max(1, max_num_shards), **settings)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        wanted = None if self.episodes is None else frozenset(self.episodes)
        for sample in super().__iter__():
            episode = int(sample["episode_index"])
            if wanted is not None and episode not in wanted:
                continue
            for name, values in sample.items():
                if isinstance(values, torch.Tensor) and values.is_floating_point() and not torch.isfinite(values).all():
                    raise NonFiniteError(
                        f"{self.repo_id}: expected finite numbers in all frames to train on, found others in {name} of "
                        f"episode {episode}, around frame {int(sample['frame_index'])}"
                    )
            yield sample
