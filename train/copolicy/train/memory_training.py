"""LeRobot's own trainer, fed from memory."""

import logging
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager

from lerobot.configs.train import TrainPipelineConfig
from lerobot.datasets import LeRobotDatasetMetadata, dataset_reader, io_utils
from lerobot.scripts import lerobot_train

from copolicy.dataset.files import on_visible_files

from .epoch_order import WholeEpochSampler
from .local_dataset import training_episodes
from .memory_dataset import MemoryDataset


def train_from_memory(config: TrainPipelineConfig) -> None:
    """Runs `lerobot_train.train` with data sets in memory; checkpoints, logs and evaluation are LeRobot's.

    Raises:
        CopolicyError: the data set cannot be trained on.
    """
    with _datasets_in_memory(), _hidden_files_passed_over():
        lerobot_train.train(config)


@contextmanager
def _datasets_in_memory() -> Iterator[None]:
    # LeRobot's trainer takes no data set or sampler of one's own; it looks these names up in its module at each run.
    original = lerobot_train.make_train_eval_datasets
    original_sampler = lerobot_train.EpisodeAwareSampler
    lerobot_train.make_train_eval_datasets = lambda config: _make_datasets(config, original)
    lerobot_train.EpisodeAwareSampler = WholeEpochSampler
    try:
        yield
    finally:
        lerobot_train.make_train_eval_datasets = original
        lerobot_train.EpisodeAwareSampler = original_sampler


@contextmanager
def _hidden_files_passed_over() -> Iterator[None]:
    # LeRobot takes every file in a folder of tables for one, also what macOS leaves beside them.
    original = io_utils.load_nested_dataset
    io_utils.load_nested_dataset = dataset_reader.load_nested_dataset = on_visible_files(original)
    try:
        yield
    finally:
        io_utils.load_nested_dataset = dataset_reader.load_nested_dataset = original


def _make_datasets(config: TrainPipelineConfig, original: Callable) -> tuple:
    if not config.resume:  # a resumed run goes on with the episodes that it began with
        _leave_out_discarded(config)
    # The co-policy says what it reads; any other policy takes what it finds.
    read = getattr(config.policy, "observation_keys", None)
    on_host = config.trainable_config.device == "cpu"
    return tuple(
        None if dataset is None else _in_memory(dataset, read, deferred=not on_host) for dataset in original(config)
    )


def _leave_out_discarded(config: TrainPipelineConfig) -> None:
    """Narrows the configured episodes, so that the checkpoint records which ones the policy was trained on."""
    source = config.dataset
    if source.streaming:
        return
    meta = LeRobotDatasetMetadata(source.repo_id, root=source.root, revision=source.revision)
    episodes = meta.episodes
    marked = episodes["discarded"] if episodes is not None and "discarded" in episodes.column_names else []
    source.episodes = training_episodes(source.episodes, meta.total_episodes, [bool(mark) for mark in marked])


def _in_memory(dataset, read: Collection[str] | None, deferred: bool):
    if MemoryDataset.can_hold(dataset, read):
        if dataset.meta.video_keys:
            logging.info("The policy does not look at %s: no video is decoded", ", ".join(dataset.meta.video_keys))
        return MemoryDataset(dataset, deferred)
    logging.warning(
        "The policy may look at images of the data set, or it is streamed: frames come through LeRobot's own loader"
    )
    return dataset
