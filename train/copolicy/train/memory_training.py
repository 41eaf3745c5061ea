"""Runs LeRobot's trainer on data sets in memory, after checking their episodes and numbers."""

import logging
import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import torch
from lerobot.configs.train import TrainPipelineConfig
from lerobot.datasets import EpisodeAwareSampler, LeRobotDatasetMetadata, dataset_reader, io_utils
from lerobot.datasets import factory as lerobot_datasets
from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset
from lerobot.scripts import lerobot_train
from lerobot.utils.constants import PRETRAINED_MODEL_DIR
from tqdm import tqdm

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.listing import skipping_hidden_files
from copolicy.dataset.policies.documents import TrainingDataDocument

from .episode_choice import recorded_episodes, resumed_episodes, selected_episodes
from .finite_data import NonFiniteError, replacement_statistics, require_finite_frames
from .finite_training import guarded_functions
from .memory_dataset import MemoryDataset
from .pair_split import PairSplit
from .training_data import TRAINING_DATA_FILE, training_data, write_training_data

_GUARDED = ("update_policy", "save_checkpoint", "update_last_checkpoint", "make_policy")


def train_from_memory(config: TrainPipelineConfig, split: PairSplit | None = None) -> None:
    """Runs `lerobot_train.train` with data sets in memory; checkpoints, logs and evaluation are LeRobot's.

    Args:
        split: pairs to train on; all episodes if None. Each checkpoint records its pairs (`training_data.json`).

    Raises:
        CopolicyError: the data set cannot be trained on, or the loss, a gradient or a weight is not finite.
    """
    guards = guarded_functions(config, {name: getattr(lerobot_train, name) for name in _GUARDED})
    make_guarded, groups = guards["make_policy"], list[Any]()

    def make_policy(*arguments: Any, **kwargs: Any) -> Any:
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            groups.append(torch.distributed.group.WORLD)
        return make_guarded(*arguments, **kwargs)

    save_guarded, facts = guards["save_checkpoint"], dict[str, Any]()

    def save_checkpoint(*, checkpoint_dir: Path, **kwargs: Any) -> None:
        save_guarded(checkpoint_dir=checkpoint_dir, **kwargs)
        if facts:
            write_training_data(checkpoint_dir / PRETRAINED_MODEL_DIR, facts)

    patches = {**guards, "make_policy": make_policy, "save_checkpoint": save_checkpoint}
    with _datasets_in_memory(split, facts), _hidden_files_ignored(), _patched(lerobot_train, patches):
        try:
            lerobot_train.train(config)
        finally:
            # An open progress bar is drawn again when it is garbage-collected, which would be after an error's line.
            for bar in list(getattr(tqdm, "_instances", ())):
                bar.close()
            if groups:
                # torch's gloo group joins its thread in its destructor with the GIL held, while that thread may need
                # the GIL to free the tensors of the last collective: a deadlock after the last step. The reference
                # keeps the group until the thread is idle.
                time.sleep(0.5)


def dataset_in_memory(
    config: TrainPipelineConfig, split: PairSplit | None = None
) -> tuple[MemoryDataset, dict[str, Any]]:
    """The data set of a training with the same checks and the same choice of episodes, for a trainer of our own.

    Returns:
        The data set, and the content of `training_data.json`.

    Raises:
        CopolicyError: the data set cannot be trained on.
        InvalidValueError: it has stored images or is streamed, so that it cannot be loaded.
    """
    facts: dict[str, Any] = {}
    with _hidden_files_ignored():
        dataset, _ = _make_datasets(config, lerobot_datasets.make_train_eval_datasets, split, facts)
    if not isinstance(dataset, MemoryDataset):
        raise InvalidValueError("--dataset", "one without stored images that is not streamed", config.dataset.repo_id)
    return dataset, facts


@contextmanager
def _datasets_in_memory(split: PairSplit | None = None, facts: dict[str, Any] | None = None) -> Iterator[None]:
    # LeRobot's trainer has no parameter for a data set or a sampler; it looks up these names in its module at each run.
    original = lerobot_train.make_train_eval_datasets
    replacements = {
        "make_train_eval_datasets": lambda config: _make_datasets(config, original, split, facts),
        "EpisodeAwareSampler": WholeEpochSampler,
    }
    with _patched(lerobot_datasets, {"StreamingLeRobotDataset": CheckedStream}), _patched(lerobot_train, replacements):
        yield


@contextmanager
def _patched(module: ModuleType, values: Mapping[str, Any]) -> Iterator[None]:
    before = {name: getattr(module, name) for name in values}
    for name, value in values.items():
        setattr(module, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            setattr(module, name, value)


@contextmanager
def _hidden_files_ignored() -> Iterator[None]:
    # LeRobot reads every file in a folder as Parquet, also hidden files that macOS creates.
    replacements = {"load_nested_dataset": skipping_hidden_files(io_utils.load_nested_dataset)}
    with _patched(io_utils, replacements), _patched(dataset_reader, replacements):
        yield


def _make_datasets(
    config: TrainPipelineConfig,
    original: Callable,
    split: PairSplit | None = None,
    facts: dict[str, Any] | None = None,
) -> tuple:
    # The co-policy states the columns that it reads; another policy may read any.
    observation_keys = getattr(config.policy, "observation_keys", None)
    on_host = config.trainable_config.device == "cpu"
    return tuple(
        None if dataset is None else _in_memory(dataset, observation_keys, deferred=not on_host)
        for dataset in _load(config, original, split, facts)
    )


def _load(
    config: TrainPipelineConfig, original: Callable, split: PairSplit | None, facts: dict[str, Any] | None
) -> tuple:
    """Loads LeRobot's data sets of the selected episodes, which the configuration and thus checkpoints then record.

    Args:
        facts: is filled with the content of `training_data.json`; None if nobody writes it.
    """
    source = config.dataset
    repo_type = "bucket" if source.repo_type == "bucket" else "dataset"
    meta = LeRobotDatasetMetadata(source.repo_id, source.root, source.revision, repo_type=repo_type)
    if config.resume and config.checkpoint_path is not None:
        episodes = resumed_episodes(meta, source.episodes, recorded_episodes(config.checkpoint_path))
    else:
        episodes = selected_episodes(meta, source.episodes if split is None else split.episodes(meta))
    all_selected = episodes == list(range(meta.total_episodes))
    statistics = replacement_statistics(meta.root, meta.stats, episodes, meta.total_episodes)
    local = source.root is not None
    if local and facts is not None and _writes_checkpoints():
        facts.update(training_data(meta.root, episodes, source.repo_id, _split_text(config, split)))
    if local:
        require_finite_frames(meta.root, episodes, meta.features)
    source.episodes = None if all_selected else episodes  # LeRobot loads a whole data set faster without a list
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
            if not local:  # downloaded by now
                require_finite_frames(dataset.meta.root, episodes, meta.features)
    return datasets


def _split_text(config: TrainPipelineConfig, split: PairSplit | None) -> str | None:
    """The split of a new run, or that which a resumed run's checkpoint records."""
    if config.resume and config.checkpoint_path is not None:
        path = config.checkpoint_path / PRETRAINED_MODEL_DIR / TRAINING_DATA_FILE
        return (read_optional_json(path, TrainingDataDocument, "the data of a training") or {}).get("split")
    return None if split is None else split.text


def _writes_checkpoints() -> bool:
    """Whether this process writes the checkpoints, of several that train together."""
    return os.environ.get("RANK", "0") == "0"


def _in_memory(dataset, observation_keys: Collection[str] | None, deferred: bool):
    if MemoryDataset.supports(dataset, observation_keys):
        if dataset.meta.video_keys:
            logging.info("The policy does not observe %s: no video is decoded", ", ".join(dataset.meta.video_keys))
        return MemoryDataset(dataset, deferred)
    logging.warning(
        "The policy may observe images of the data set, or it is streamed: frames come through LeRobot's own loader"
    )
    return dataset


class WholeEpochSampler(EpisodeAwareSampler):
    """LeRobot's sampler with the same order, computed for the whole epoch at its start.

    LeRobot computes the frame of each position separately, which takes 2.6 us per sample, longer than all other work of
    loading from memory. Computed at once it takes 0.08 us per sample, and a list of the frames in memory.
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
    """LeRobot's streamed data set without the samples of episodes that were not selected.

    Raises:
        NonFiniteError: on iteration, at a sample with a NaN or infinite value.
    """

    def __init__(self, *arguments: Any, max_num_shards: int = 1, **settings: Any):
        # LeRobot passes the number of worker processes, which is 0 here, and would then read nothing.
        super().__init__(*arguments, max_num_shards=max(1, max_num_shards), **settings)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        selected = None if self.episodes is None else frozenset(self.episodes)
        for sample in super().__iter__():
            episode = int(sample["episode_index"])
            if selected is not None and episode not in selected:
                continue
            for name, values in sample.items():
                if isinstance(values, torch.Tensor) and values.is_floating_point() and not torch.isfinite(values).all():
                    raise NonFiniteError(
                        f"{self.repo_id}: expected finite numbers in all frames to train on, found others in {name} of "
                        f"episode {episode}, around frame {int(sample['frame_index'])}"
                    )
            yield sample
