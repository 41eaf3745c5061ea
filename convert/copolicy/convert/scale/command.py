"""`copolicy-convert mcap` in shards: the flags, and the conversion of recordings to the merged data set."""

import argparse
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.flag_numbers import whole_number
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.files.staging import require_new

from ..lerobot.prepare import Conversion
from ..recordings import find_recordings, require_rate
from .shard_plan import LOCK_FILE, ShardPlan, absolute

SHARD_EPISODES = 500
"""Default number of recordings in a shard: a killed process loses seconds of work, and few parts are merged."""

_EXECUTORS = ("local", "slurm", "ray")


@dataclass(frozen=True)
class Scale:
    """How a conversion in shards is distributed.

    Attributes:
        executor: `local`, `slurm` or `ray`.
        workers: number of shards converted at a time; None for one locally, for all on a cluster.
        shard_episodes: recordings in a shard.
        folder: where shards are kept; by default beside the data set until it is complete.
        statistics: also compute the statistics of the data set.
        slurm: arguments of `SlurmOptions`.
    """

    executor: str = "local"
    workers: int | None = None
    shard_episodes: int = SHARD_EPISODES
    folder: Path | None = None
    statistics: bool = False
    slurm: dict[str, Any] = field(default_factory=dict)


def add_scale_flags(parser: argparse.ArgumentParser) -> None:
    """Adds the flags of a conversion in shards."""
    group = parser.add_argument_group(
        "many recordings",
        "With one of these flags, recordings are converted in shards, which are merged at the end; after an "
        "interruption, the same call continues with the unfinished shards. --workers alone uses shards for more than "
        f"{SHARD_EPISODES} recordings only; fewer are read by N processes and written in one pass.",
    )
    group.add_argument(
        "--workers",
        type=whole_number("--workers", None, 1024),
        metavar="N",
        help="number of shards converted at a time (default: 1; on a cluster: all)",
    )
    group.add_argument("--executor", choices=_EXECUTORS, help="where shards are converted (default: local)")
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
    group.add_argument("--partition", help="SLURM partition")
    group.add_argument("--time", metavar="HH:MM:SS", help="time limit of a shard's SLURM job (default: 01:00:00)")
    group.add_argument("--memory-gb", type=whole_number("--memory-gb"), metavar="N", help="per SLURM job (default: 4)")
    group.add_argument(
        "--setup", metavar="COMMAND", help="activates the environment of a SLURM job (default: this virtual one)"
    )
    group.add_argument(
        "--sbatch", action="append", metavar="KEY=VALUE", help="further option of sbatch, such as account=lab"
    )


def shards_requested(arguments: argparse.Namespace) -> bool:
    """Whether a flag requests shards for any number of recordings."""
    flags = (arguments.executor, arguments.shard_episodes, arguments.shards, arguments.stats or None)
    return any(value is not None for value in flags)


def scale_from_flags(arguments: argparse.Namespace) -> Scale | None:
    """Returns the scale that the flags state, None for a conversion without shards."""
    slurm = {
        name: value
        for name in ("partition", "time", "memory_gb", "setup")
        if (value := getattr(arguments, name)) is not None
    }
    if arguments.sbatch:
        slurm["arguments"] = tuple(_option(text) for text in arguments.sbatch)
    executor = arguments.executor or "local"
    if slurm and executor != "slurm":
        name = next(iter(slurm)).replace("_", "-").replace("arguments", "sbatch")
        raise InvalidValueError(f"--{name}", "--executor slurm beside it", executor)
    size = SHARD_EPISODES if arguments.shard_episodes is None else arguments.shard_episodes
    for name, value in (("--workers", arguments.workers), ("--shard-episodes", size)):
        if value is not None and value < 1:
            raise InvalidValueError(name.removeprefix("--"), "at least 1", value)
    scale = Scale(executor, arguments.workers, size, arguments.shards, arguments.stats, slurm)
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
    from .executors import SlurmOptions, require_executor, run_local, run_ray, submit_slurm

    require_new(root)
    require_executor(scale.executor, scale.slurm.get("partition"))
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
        if scale.executor == "slurm":
            jobs = submit_slurm(plan, scale.workers, SlurmOptions(**scale.slurm))
            return {
                "root": str(root), "shards": len(plan), "finished_before": finished, "kept": str(folder), "jobs": jobs,
            }  # fmt: skip
        if scale.executor == "ray":
            run_ray(plan, scale.workers)
        else:
            run_local(plan, scale.workers or 1)
        from .merge_shards import merge_shards

        summary = {**merge_shards(plan), "finished_before": finished}
    if scale.folder is not None:
        return {**summary, "kept": str(folder)}
    shutil.rmtree(folder)
    return summary


def _option(text: str) -> tuple[str, str]:
    key, _, value = text.partition("=")
    if not key or key.startswith("-"):
        raise InvalidValueError("--sbatch", "KEY=VALUE, such as account=lab", text)
    return key, value
