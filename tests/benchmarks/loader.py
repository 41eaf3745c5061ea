"""Samples a second through LeRobot's own data loader and through the one in memory, in one run.

    uv run python tests/benchmarks/loader.py
    uv run python tests/benchmarks/loader.py --root=data/table --batch-size=512

Without `--root` it writes a small data set first. Both loaders yield the windows of the co-policy through torch's
DataLoader without workers, as `lerobot-train --num_workers=0` and `copolicy-train` do; rounds alternate and the
medians are compared, since the speed of a shared machine moves.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
import torch
from lerobot.datasets import EpisodeAwareSampler, LeRobotDataset
from torch.utils.data import DataLoader

from copolicy.tasks.table.features import FEATURES, TASK
from copolicy.train.memory_dataset import MemoryDataset
from copolicy.train.memory_training import WholeEpochSampler

_FPS = 10
_WINDOWS = {
    **{key: [frame / _FPS for frame in (-2, -1, 0)] for key in FEATURES if key.startswith("observation.")},
    "action": [frame / _FPS for frame in range(-2, 10)],
}


def main() -> None:
    """Runs the comparison and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, help="a LeRobot data set of this task; by default a small one is written")
    parser.add_argument("--batch-size", type=int, default=256)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        root = arguments.root or _write(Path(folder) / "table")
        stock = LeRobotDataset("local/table", root=root, delta_timestamps=_WINDOWS, video_backend="pyav")
        loaders = {
            "LeRobot's": (_loader(stock, EpisodeAwareSampler, arguments.batch_size), 2),
            "in memory": (_loader(MemoryDataset(stock), WholeEpochSampler, arguments.batch_size), 500),
        }
        rates: dict[str, list[float]] = {name: [] for name in loaders}
        for _ in range(arguments.rounds):
            for name, (loader, batches) in loaders.items():
                rates[name].append(_rate(loader, batches))
        print(f"{len(stock)} frames, batches of {arguments.batch_size}, {arguments.rounds} rounds, one thread")
        for name, values in rates.items():
            print(
                f"{name:<10} {statistics.median(values):>12,.0f} samples/s ({min(values):,.0f} to {max(values):,.0f})"
            )
        slow, fast = (statistics.median(values) for values in rates.values())
        print(f"{'ratio':<10} {fast / slow:>12,.0f}")


def _loader(dataset, sampler, batch_size: int) -> DataLoader:
    episodes = dataset.meta.episodes
    order = sampler(episodes["dataset_from_index"], episodes["dataset_to_index"], shuffle=True)
    return DataLoader(dataset, batch_size=batch_size, sampler=order)


def _rate(loader: DataLoader, batches: int) -> float:
    samples, start = 0, time.perf_counter()
    while batches > 0:
        for batch in loader:
            samples += len(batch["action"])
            batches -= 1
            if batches == 0:
                break
    return samples / (time.perf_counter() - start)


def _write(root: Path) -> Path:
    dataset = LeRobotDataset.create("local/table", _FPS, FEATURES, root=root, use_videos=False, video_backend="pyav")
    random = np.random.default_rng(0)
    for _ in range(10):
        for frame in range(170):
            values = {
                key: random.uniform(-1, 1, feature["shape"]).astype(feature["dtype"])
                for key, feature in FEATURES.items()
                if feature["dtype"] == "float32"
            }
            last = np.array([frame == 169])
            dataset.add_frame({**values, "next.done": last, "next.success": last, "task": TASK})
        dataset.save_episode()
    dataset.finalize()
    return root


if __name__ == "__main__":
    main()
