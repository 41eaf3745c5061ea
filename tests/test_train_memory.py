"""The data set in memory yields the stock loader's batches in the stock sampler's order."""

from itertools import chain
from types import SimpleNamespace
from typing import Any

import pyarrow.parquet as pq
import pytest
import torch
from accelerate import Accelerator
from accelerate.data_loader import BatchSamplerShard
from lerobot.datasets import EpisodeAwareSampler
from torch.utils.data import BatchSampler, DataLoader, Subset, default_collate
from training_table import LENGTHS, assert_same_batch, windows

from copolicy.dataset.exceptions import RunError
from copolicy.dataset.features import STATE
from copolicy.tasks.table.features import TASK
from copolicy.train.memory_dataset import DeferredBatch, MemoryDataset
from copolicy.train.memory_training import WholeEpochSampler, _make_datasets


@pytest.mark.parametrize("episodes", [None, [4, 1, 2]])
def test_batches_are_the_stock_loaders(random_table, episodes):
    stock = windows(random_table, episodes=episodes)
    memory = MemoryDataset(stock)
    assert (len(memory), memory.num_frames, memory.num_episodes) == (len(stock), stock.num_frames, stock.num_episodes)
    indices = torch.randperm(len(stock), generator=torch.Generator().manual_seed(0)).tolist()
    for order in (range(len(stock)), indices[:7]):
        assert_same_batch(
            next(iter(DataLoader(Subset(memory, list(order)), batch_size=len(order)))),
            default_collate([stock[index] for index in order]),
        )
    assert_same_batch(memory[3], stock[3])


def test_windows_are_padded_at_both_ends_of_an_episode(random_table):
    memory = MemoryDataset(windows(random_table))
    first, last = LENGTHS[0], LENGTHS[0] + LENGTHS[1] - 1
    batch = memory.window_batch([first, last])
    assert batch["action_is_pad"][0].tolist() == [True, True] + [False] * 5 + [True] * 5
    assert batch["action_is_pad"][1].tolist() == [False] * 3 + [True] * 9
    assert torch.equal(batch["action"][0, 0], batch["action"][0, 2])
    assert torch.equal(batch["action"][1, -1], batch["action"][1, 2])
    assert torch.equal(batch[STATE][0, 0], batch[STATE][0, 2])


@pytest.mark.parametrize("workers", [0, 1])
def test_a_batch_passes_the_loader_in_one_piece(random_table, workers):
    loader = DataLoader(MemoryDataset(windows(random_table)), batch_size=16, num_workers=workers)
    batch = next(iter(loader))
    assert batch["action"].shape == (16, 12, 4)
    assert batch["task"] == [TASK] * 16


def test_rows_out_of_order_are_refused(copied_table):
    path = copied_table / "data" / "chunk-000" / "file-000.parquet"
    table = pq.read_table(path)
    order = [*range(3), 4, 3, *range(5, len(table))]
    pq.write_table(table.take(order[len(table) // 2 :] + order[: len(table) // 2]), path)
    with pytest.raises(RunError, match="expected the rows of each episode together and in order"):
        MemoryDataset(windows(copied_table))


@pytest.mark.parametrize("shuffle", [True, False])
@pytest.mark.parametrize("episodes", [None, [0, 3]])
def test_order_is_the_stock_samplers(random_table, shuffle, episodes):
    dataset = windows(random_table, episodes=episodes)
    table = dataset.meta.episodes
    samplers = [
        kind(
            table["dataset_from_index"],
            table["dataset_to_index"],
            episode_indices_to_use=episodes,
            drop_n_last_frames=6,
            shuffle=shuffle,
            seed=7,
            absolute_to_relative_idx=dataset.absolute_to_relative_idx,
        )
        for kind in (WholeEpochSampler, EpisodeAwareSampler)
    ]
    assert list(samplers[0]) == list(samplers[1])
    for sampler in samplers:
        sampler.load_state_dict({"epoch": 3, "start_index": 5})
    assert list(samplers[0]) == list(samplers[1])


def test_a_batch_for_a_device_is_gathered_there(random_table):
    """As for a GPU: the loader hands on positions, and what is sent to the device are they alone."""
    stock = windows(random_table)
    deferred = MemoryDataset(stock, deferred=True)
    loader = DataLoader(deferred, batch_size=16)
    (first, *_) = list(loader)
    assert isinstance(first, DeferredBatch)
    assert len(first) == 16
    on_device = first.to("meta")  # a device of torch whose tensors have shapes and no values
    assert {values.device.type for values in on_device.values() if isinstance(values, torch.Tensor)} == {"meta"}
    assert on_device["action"].shape == (16, 12, 4)
    assert on_device["task"] == [TASK] * 16
    prepared = Accelerator(cpu=True).prepare(DataLoader(deferred, batch_size=16))
    for batch, expected in zip(prepared, DataLoader(MemoryDataset(stock), batch_size=16), strict=True):
        assert_same_batch(batch, expected)


@pytest.mark.parametrize(("device", "deferred"), [("cpu", False), ("cuda", True)])
def test_training_on_a_device_gathers_there(random_table, device, deferred):
    policy = SimpleNamespace(device=device, observation_keys=[STATE])
    source = SimpleNamespace(
        repo_id="local/table", root=random_table, revision=None, repo_type="dataset", episodes=None
    )
    config: Any = SimpleNamespace(resume=False, policy=policy, trainable_config=policy, dataset=source)
    training, evaluation = _make_datasets(config, lambda _: (windows(random_table), None))
    assert evaluation is None
    (batch,) = training.__getitems__([0, 3])
    assert isinstance(batch, DeferredBatch) == deferred
    expected = MemoryDataset(windows(random_table)).window_batch([0, 3])
    assert_same_batch(batch.to("cpu") if deferred else batch, expected)


@pytest.mark.parametrize("processes", [2, 3])
def test_processes_share_an_epoch_without_overlap(random_table, processes):
    """Side by side, the batches of all processes are those of one process with their batch sizes together."""
    episodes = windows(random_table).meta.episodes

    def batches(size: int) -> BatchSampler:
        order = WholeEpochSampler(episodes["dataset_from_index"], episodes["dataset_to_index"], shuffle=True, seed=7)
        return BatchSampler(order, size, drop_last=False)

    parts = [list(BatchSamplerShard(batches(4), processes, rank)) for rank in range(processes)]
    whole = list(batches(4 * processes))
    together = [list(chain(*batch)) for batch in zip(*parts, strict=True)]
    assert together[:-1] == whole[:-1]
    # accelerate fills the last round with frames of the first one, so that all processes make as many steps.
    assert together[-1][: len(whole[-1])] == whole[-1]
    assert sorted(chain(*whole)) == list(range(sum(LENGTHS)))
