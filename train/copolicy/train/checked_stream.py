"""LeRobot's streamed data set, whose every sample is one that may be trained on."""

from collections.abc import Iterator
from typing import Any

import torch
from lerobot.datasets.streaming_dataset import StreamingLeRobotDataset

from .finite_data import NonFiniteError


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
