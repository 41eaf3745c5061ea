"""A small LeRobot data set of this task for the tests of training, and what they do with it."""

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import torch
from accelerate.state import AcceleratorState
from lerobot.datasets import LeRobotDataset
from safetensors.torch import load_file

from copolicy.dataset.features import ACTION, features_of
from copolicy.dataset.lerobot_folder.info import robot_type
from copolicy.dataset.task import get_task
from copolicy.tasks.table.features import FEATURES
from copolicy.train.cli import with_defaults

LENGTHS = (14, 5, 20, 11, 17, 8)
"""Frames of each episode."""

_WINDOWS = {
    **{key: [-0.2, -0.1, 0.0] for key in FEATURES if key.startswith("observation.")},
    "action": [frame / 10 for frame in range(-2, 10)],
}
_SMALL = ["--policy.preset=small", "--policy.width=16", "--policy.n_layers=1", "--policy.device=cpu"]


def write_table(
    root: Path, lengths: tuple[int, ...] = LENGTHS, learnable: bool = False, task: str | None = None
) -> Path:
    """Writes random frames with LeRobot's own writer; no episode is marked as discarded.

    Where it shall be learnable, both players push to the right in all of them. No task named: the table, and data that
    do not say so.
    """
    spec = get_task(task or "table").spec
    features, robot = features_of(spec), robot_type(task) if task else None
    dataset = LeRobotDataset.create(
        "local/table", 10, features, root=root, robot_type=robot, use_videos=False, video_backend="pyav"
    )
    random = np.random.default_rng(0)
    for length in lengths:
        for frame in range(length):
            values = {
                key: random.uniform(-1, 1, feature["shape"]).astype(feature["dtype"])
                for key, feature in features.items()
                if feature["dtype"] == "float32"
            }
            if learnable:
                values[ACTION] = np.array([0.9, 0.0, 0.6, 0.0], np.float32) + 0.1 * values[ACTION]
            last = np.array([frame == length - 1])
            dataset.add_frame({**values, "next.done": last, "next.success": last, "task": spec.sentence})
        dataset.save_episode()
    dataset.finalize()
    mark_discarded(root, ())
    return root


def mark_discarded(root: Path, discarded) -> None:
    """Marks these episodes, and no other, as discarded."""
    for path in (root / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        if "discarded" in table.column_names:
            table = table.drop_columns("discarded")
        marks = pa.array([episode in discarded for episode in table.column("episode_index").to_pylist()])
        pq.write_table(table.append_column("discarded", marks), path)


def windows(root: Path, **settings) -> Any:
    """LeRobot's own data set with the windows of the co-policy."""
    return LeRobotDataset("local/table", root=root, delta_timestamps=_WINDOWS, video_backend="pyav", **settings)


def flags(root: Path, output: Path, **more) -> list[str]:
    """A short training of a tiny network."""
    settings = {"batch_size": 8, "steps": 4, "save_freq": 2, "log_freq": 1, **more}
    return [
        f"--dataset.root={root}",
        f"--output_dir={output}",
        *_SMALL,
        *(f"--{name}={value}" for name, value in settings.items()),
    ]


def lerobot_train(monkeypatch, arguments: list[str]) -> None:
    """Runs LeRobot's own command."""
    from lerobot.scripts import lerobot_train as script

    monkeypatch.setattr(sys, "argv", ["lerobot-train", *with_defaults(arguments)])
    script.main()


@contextlib.contextmanager
def new_accelerate(**variables: str) -> Iterator[None]:
    """Accelerate as in a new process with these variables alone; otherwise the first training's precision stays."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ACCELERATE_")}
    AcceleratorState._reset_state(reset_partial_state=True)
    try:
        with patch.dict(os.environ, {**kept, **variables}, clear=True):
            yield
    finally:
        AcceleratorState._reset_state(reset_partial_state=True)


def weights(output: Path, step: int = 4) -> dict[str, torch.Tensor]:
    """Those of a checkpoint."""
    return load_file(output / "checkpoints" / f"{step:06d}" / "pretrained_model" / "model.safetensors")


def losses(log: str) -> list[float]:
    """The loss of each line of a training's log that has one."""
    return [float(line.split("loss:")[1].split()[0]) for line in log.splitlines() if "loss:" in line]


def assert_same_batch(ours: dict, theirs: Any) -> None:
    """Same keys in the same order, same values and dtypes."""
    assert list(ours) == list(theirs)
    for key, values in theirs.items():
        if isinstance(values, torch.Tensor):
            assert ours[key].dtype == values.dtype, key
            assert torch.equal(ours[key], values), key
        else:
            assert ours[key] == values, key


def assert_same_weights(ours: dict[str, torch.Tensor], theirs: dict[str, torch.Tensor]) -> None:
    """Bit for bit."""
    assert ours.keys() == theirs.keys()
    for key, values in theirs.items():
        assert torch.equal(ours[key], values), key
