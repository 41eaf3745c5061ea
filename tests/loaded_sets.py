"""Data sets as LeRobot loads them, and whether two load alike."""

from pathlib import Path
from typing import Any

import numpy as np
from lerobot.datasets import LeRobotDataset


def load(root: Path) -> Any:
    return LeRobotDataset("lab/table", root=root, video_backend="pyav")


def assert_same_frames(ours: Any, theirs: Any, every: int) -> None:
    """Every so many frames, value by value."""
    assert ours.num_frames == theirs.num_frames
    for index in range(0, theirs.num_frames, every):
        for name, value in theirs[index].items():
            assert np.array_equal(ours[index][name], value), name


def assert_same_statistics(ours: Any, theirs: Any) -> None:
    """Up to the rounding of a mean over parts."""
    for feature, kinds in theirs.meta.stats.items():
        for kind, value in kinds.items():
            np.testing.assert_allclose(ours.meta.stats[feature][kind], value, rtol=1e-9, atol=1e-12, err_msg=feature)
