"""Data sets of two-player tasks: reading, checks, statistics, versions and publication.

    from copolicy.dataset import load_dataset

    dataset = load_dataset("outputs/quickstart/dataset")
    dataset.episodes[0].states  # (T, 7)
    dataset.table.to_pandas()   # one row per episode

Names are imported on first access.
"""

from typing import TYPE_CHECKING

from .lazy_names import lazy_names

if TYPE_CHECKING:
    from .checks.checking import check_dataset
    from .episode import Episode, EpisodeMeta
    from .exceptions import CopolicyError
    from .pair_dataset import DatasetEpisode, PairDataset, load_dataset
    from .recording.reader import read_episode
    from .statistics.compute import dataset_statistics
    from .task import PairTask, get_task, installed_tasks
    from .task_spec import TaskSpec, Vector

__all__ = [
    "CopolicyError",
    "DatasetEpisode",
    "Episode",
    "EpisodeMeta",
    "PairDataset",
    "PairTask",
    "TaskSpec",
    "Vector",
    "check_dataset",
    "dataset_statistics",
    "get_task",
    "installed_tasks",
    "load_dataset",
    "read_episode",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "check_dataset": "checks.checking",
        **dict.fromkeys(("Episode", "EpisodeMeta"), "episode"),
        "CopolicyError": "exceptions",
        **dict.fromkeys(("DatasetEpisode", "PairDataset", "load_dataset"), "pair_dataset"),
        "read_episode": "recording.reader",
        "dataset_statistics": "statistics.compute",
        **dict.fromkeys(("PairTask", "get_task", "installed_tasks"), "task"),
        **dict.fromkeys(("TaskSpec", "Vector"), "task_spec"),
    },
)
