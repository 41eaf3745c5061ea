"""`copolicy-convert mcap` in shards: the flags, and the conversion of recordings to the merged data set."""

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.flag_numbers import whole_number
from copolicy.dataset.distributed.flags import Distribution, add_distribution_flags, distribution_from_flags
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import require_new

from ..lerobot.prepare import Conversion
from ..recordings import find_recordings, require_rate
from .shard_plan import LOCK_FILE, ShardPlan, absolute

SHARD_EPISODES = 500
"""Default number of recordings in a shard: a killed process loses seconds of work, and few parts are merged."""


@dataclass(frozen=True)
class Scale:
    """How a conversion in shards is distributed.

    Attributes:
        distribution: where shards are converted.
        shard_episodes: recordings in a shard.
        folder: where shards are kept; by default beside the data set until it is complete.
        statistics: also compute the statistics of the data set.
    """

    distribution: Distribution = field(default_factory=Distribution)
    shard_episodes: int = SHARD_EPISODES
    folder: Path | None = None
    statistics: bool = False


def add_scale_flags(parser: argparse.ArgumentParser) -> None:
    """Adds the flags of a conversion in shards."""
    group = parser.add_argument_group(
        "many recordings",
        "With one of these flags, recordings are converted in shards, which are merged at the end; after an "
        "interruption, the same call continues with the unfinished shards. --workers alone uses shards for more than "
        f"{SHARD_EPISODES} recordings only; fewer are read by N processes and written in one pass.",
    )
    add_distribution_flags(group, "shard")
    group.add_argument(
        "--shard-episodes",
        type=whole_number("--shard-episodes", None),
        metavar="N",
        help=f"recordings in a shard (default: {SHARD_EPISODES})",
    )
    group.add_argument(
        "--shards", type=Path, metavar="FOLDER",
        help="keep shards and findings in FOLDER (default: beside OUT until OUT is complete)",
    )  # fmt: skip
    group.add_argument("--stats", action="store_true", help="also compute meta/copolicy_stats.json")


def shards_requested(arguments: argparse.Namespace) -> bool:
    """Whether a flag requests shards for any number of recordings."""
    flags = (arguments.executor, arguments.shard_episodes, arguments.shards, arguments.stats or None)
    return any(value is not None for value in flags)


def scale_from_flags(arguments: argparse.Namespace) -> Scale | None:
    """Returns the scale that the flags state, None for a conversion without shards."""
    distribution = distribution_from_flags(arguments)
    size = SHARD_EPISODES if arguments.shard_episodes is None else arguments.shard_episodes
    if size < 1:
        raise InvalidValueError("shard-episodes", "at least 1", size)
    scale = Scale(distribution, size, arguments.shards, arguments.stats)
    if shards_requested(arguments):
        if arguments.append:
            raise InvalidValueError("--append", "no flag of a conversion in shards beside it", True)
        return scale
    if arguments.append:
        return None
    if (arguments.workers or 1) > 1 and len(find_recordings(arguments.folders)[0]) > size:
        return scale
    return None


def convert_in_shards(
    folders: Sequence[Path], root: Path, repo_id: str, conversion: Conversion, skip_damaged: bool, scale: Scale
) -> dict[str, Any]:
    """Converts the recordings in `folders` in shards and merges these; see `recordings.convert_recordings`.

    Shards that an earlier call finished are converted again only if one of their recordings changed.

    Returns:
        Summary of the written and skipped episodes and the findings; for SLURM, of the submitted jobs.

    Raises:
        OutputExistsError: `root` exists.
        FileFormatError: no recordings, or the folder holds something else than shards.
        InvalidValueError: the shards were made by a call with other options.
        RunError: damaged recordings, or a killed process; the finished shards are kept.
        MissingExtraError: datatrove or lerobot is not installed.
    """
    from .executors import convert_shards, submit_shards

    require_new(root)
    scale.distribution.require()
    files, unfinished = find_recordings(folders)
    require_rate(conversion, files[0])
    root = root.absolute()
    folder = (scale.folder or root.parent / f".{root.name}.shards").absolute()
    plan = ShardPlan(
        folder, root, repo_id, conversion, absolute(files), scale.shard_episodes, skip_damaged, scale.statistics,
        tuple(unfinished),
    )  # fmt: skip
    plan.require_own()
    refusal = f"{folder}: expected shards that no other call works on, found one at work"
    with FolderLock(folder / LOCK_FILE, refusal):
        finished = plan.prepare()
        if scale.distribution.executor == "slurm":
            jobs = submit_shards(plan, scale.distribution)
            return {
                "root": str(root), "shards": len(plan), "finished_before": finished, "kept": str(folder), "jobs": jobs,
            }  # fmt: skip
        convert_shards(plan, scale.distribution)
        from .merge_shards import merge_shards

        summary = {**merge_shards(plan), "finished_before": finished}
    if scale.folder is not None:
        return {**summary, "kept": str(folder)}
    shutil.rmtree(folder)
    return summary
