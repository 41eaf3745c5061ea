"""Joins data sets with LeRobot's aggregation, without its console output and with correct statistics."""

import contextlib
import io
import logging
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import MissingExtraError
from copolicy.dataset.files.listing import skipping_hidden_files
from copolicy.dataset.lerobot_folder.info import read_info

from .shifted_tables import Shift

try:
    from datasets import config
    from lerobot.datasets import io_utils
    from lerobot.datasets.aggregate import aggregate_datasets
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.io_utils import load_stats, write_stats
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


def join_data_sets(
    roots: Sequence[Path], repo_id: str, target: Path, cache: Path, concatenate_data: bool = True
) -> None:
    """Writes the episodes of several data sets with the same features, one after the other, as one data set.

    Video files are copied, not concatenated: concatenation would change their packets. LeRobot copies the statistics
    of `index` and `episode_index` unchanged from the parts; here they are shifted with the numbers.

    Args:
        target: a new folder.
        cache: a temporary folder, removed at the end.
        concatenate_data: fill data files up to LeRobot's size limit, for which LeRobot rewrites a file for every part
            that it appends.
    """
    with _quiet(cache):
        aggregate_datasets(
            [repo_id] * len(roots), repo_id, list(roots), target,
            concatenate_data=concatenate_data, concatenate_videos=False,
        )  # fmt: skip
    write_stats(aggregate_stats(list(_shifted_statistics(roots))), target)


def _shifted_statistics(roots: Sequence[Path]) -> Iterator[dict[str, dict[str, Any]]]:
    episodes = frames = 0
    for root in roots:
        yield Shift(episodes, frames).statistics(load_stats(root) or {})
        info = read_info(root)
        episodes, frames = episodes + info["total_episodes"], frames + info["total_frames"]


@contextlib.contextmanager
def _quiet(cache: Path) -> Iterator[None]:
    """Silences LeRobot, redirects its cache and hides hidden files from it.

    It logs each step, draws progress bars even where stderr is no terminal, copies every table of episodes to the
    user's cache, and reads hidden files as tables."""
    logger = logging.getLogger("lerobot")
    level, default_cache = logger.level, config.HF_DATASETS_CACHE
    logger.setLevel(logging.WARNING)
    config.HF_DATASETS_CACHE = cache
    load = io_utils.load_nested_dataset
    io_utils.load_nested_dataset = skipping_hidden_files(load)
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        io_utils.load_nested_dataset = load
        config.HF_DATASETS_CACHE = default_cache
        logger.setLevel(level)
        shutil.rmtree(cache, ignore_errors=True)
