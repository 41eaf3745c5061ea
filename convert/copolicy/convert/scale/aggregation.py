"""LeRobot's aggregation of data sets, and what it loses put back."""

import contextlib
import io
import json
import logging
import math
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.episode import EPISODE_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError

from ..shifted_tables import Shift, numbered_files, read_table, write_like

try:
    import pyarrow as pa
    import pyarrow.compute as pc
    from datasets import config
    from lerobot.datasets.aggregate import aggregate_datasets
    from lerobot.datasets.compute_stats import aggregate_stats
    from lerobot.datasets.io_utils import load_stats, write_stats
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None

_INFO = Path("meta/info.json")


def aggregate(roots: Sequence[Path], repo_id: str, target: Path, cache: Path) -> dict[str, Any]:
    """One data set out of several with the same features, in their order.

    LeRobot joins them, one file of frames (and of video) a part: to pack parts into one file it reads and writes that
    file again for each of them. What else it does to them is undone: a number that was not measured (NaN) becomes
    null, statistics of `index` and `episode_index` stay those of the parts, video features lose what names their
    encoder.

    Args:
        target: a new folder.
        cache: a folder for its own use; it goes away at the end.

    Returns:
        `meta/info.json` of the result.

    Raises:
        FileFormatError: a part is not complete. LeRobot would look for it on the Hub.
    """
    for root in roots:
        for name in ("meta/info.json", "meta/stats.json", "meta/tasks.parquet", "meta/episodes", "data"):
            if not (root / name).exists():
                raise FileFormatError(root, f"a complete data set with {name}", "none; delete the shard's folder")
    with _quiet(cache):
        aggregate_datasets(
            [repo_id] * len(roots), repo_id, list(roots), target, concatenate_data=False, concatenate_videos=False
        )
    infos = [json.loads((root / _INFO).read_text()) for root in roots]
    info = json.loads((target / _INFO).read_text())
    info["features"] = infos[0]["features"]
    (target / _INFO).write_text(json.dumps(info, indent=4, ensure_ascii=False))
    example = next(iter(numbered_files(roots[0] / "meta" / "episodes").values()))
    for path in numbered_files(target / "meta" / "episodes").values():
        write_like(_with_nan(read_table(path)), example, path)
    write_stats(aggregate_stats(list(_shifted(roots, infos))), target)
    return info


def _shifted(roots: Sequence[Path], infos: Sequence[dict[str, Any]]) -> Iterator[dict[str, dict[str, Any]]]:
    episodes = frames = 0
    for root, info in zip(roots, infos, strict=True):
        yield Shift(episodes, frames).statistics(load_stats(root) or {})
        episodes, frames = episodes + info["total_episodes"], frames + info["total_frames"]


def _with_nan(table: "pa.Table") -> "pa.Table":
    for name, kind in EPISODE_COLUMNS.items():
        if kind == "float" and table.column(name).null_count:
            filled = pc.fill_null(table.column(name).cast(pa.float64()), math.nan)
            table = table.set_column(table.column_names.index(name), name, filled)
    return table


@contextlib.contextmanager
def _quiet(cache: Path) -> Iterator[None]:
    """Neither LeRobot's progress bars nor a copy of each part's metadata in the user's cache."""
    logger = logging.getLogger("lerobot")
    level, place = logger.level, config.HF_DATASETS_CACHE
    logger.setLevel(logging.WARNING)
    config.HF_DATASETS_CACHE = cache
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        config.HF_DATASETS_CACHE = place
        logger.setLevel(level)
        shutil.rmtree(cache, ignore_errors=True)
