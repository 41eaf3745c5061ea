"""LeRobot's aggregation of data sets with the same features, without its noise and with statistics that hold."""

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
    """Writes several data sets, one after the other, as one.

    Videos stay in the files they are in: joined, their packets would be written in another form. LeRobot leaves the
    statistics of the running numbers `index` and `episode_index` as they are in the parts; here they move along.

    Args:
        target: a new folder.
        cache: a folder for its own use; it goes away at the end.
        concatenate_data: fill up files of frames, for which LeRobot reads and writes a file again for every part that
            goes into it.
    """
    with _quiet(cache):
        aggregate_datasets(
            [repo_id] * len(roots), repo_id, list(roots), target,
            concatenate_data=concatenate_data, concatenate_videos=False,
        )  # fmt: skip
    write_stats(aggregate_stats(list(_moved_statistics(roots))), target)


def _moved_statistics(roots: Sequence[Path]) -> Iterator[dict[str, dict[str, Any]]]:
    episodes = frames = 0
    for root in roots:
        yield Shift(episodes, frames).statistics(load_stats(root) or {})
        info = read_info(root)
        episodes, frames = episodes + info["total_episodes"], frames + info["total_frames"]


@contextlib.contextmanager
def _quiet(cache: Path) -> Iterator[None]:
    """LeRobot logs each of its steps, draws progress bars whether or not stderr is a terminal, and leaves a copy of
    each table of episodes in the user's cache, here in one that goes away. It takes hidden files for tables."""
    logger = logging.getLogger("lerobot")
    level, place = logger.level, config.HF_DATASETS_CACHE
    logger.setLevel(logging.WARNING)
    config.HF_DATASETS_CACHE = cache
    load, io_utils.load_nested_dataset = (
        io_utils.load_nested_dataset,
        skipping_hidden_files(io_utils.load_nested_dataset),
    )
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        io_utils.load_nested_dataset = load
        config.HF_DATASETS_CACHE = place
        logger.setLevel(level)
        shutil.rmtree(cache, ignore_errors=True)
