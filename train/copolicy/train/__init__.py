"""LeRobot's trainer with data sets in memory; checkpoints loaded and exported.

    from copolicy.train import Checkpoint, MemoryDataset, export_checkpoint

    policy = Checkpoint("outputs/training")     # any LeRobot policy trained on our data, for evaluation
    frames = MemoryDataset(LeRobotDataset(...))  # for torch's DataLoader: whole batches of windows

Names are imported on first use.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .checkpoint import Checkpoint
    from .export import export_checkpoint
    from .memory_dataset import MemoryDataset

__all__ = ["Checkpoint", "MemoryDataset", "export_checkpoint"]

__getattr__, __dir__ = lazy_names(
    __name__, {"Checkpoint": "checkpoint", "MemoryDataset": "memory_dataset", "export_checkpoint": "export"}
)
