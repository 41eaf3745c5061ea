"""`copolicy-convert mcap --workers N`: flags, and the way from recordings to the merged data set."""

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
from .plan import LOCK_FILE, ShardPlan, absolute

SHARD_EPISODES = 500
"""Recordings in a shard where none is asked for: seconds of work that a kill can lose, few parts to merge."""

_EXECUTORS = ("local", "slurm", "ray")


@dataclass(frozen=True)
class Scale:
    """How the work is spread.

    Attributes:
        executor: `local`, `slurm` or `ray`.
        workers: shards at a time; None for one here, for all on a cluster.
        shard_episodes: recordings in a shard.
        folder: where shards are kept; by default beside the data set, until it is complete.
        statistics: compute the statistics of the data set, too.
        slurm: of the jobs.
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
        "With one of these flags, recordings are converted in shards that are finished or not there at all, and merged "
        "at the end: after an interruption the same call goes on. --workers alone makes shards of more than "
        f"{SHARD_EPISODES} recordings only; fewer are read by that many processes and written in one go.",
    )
    group.add_argument(
        "--workers",
        type=whole_number("--workers", None, 1024),
        metavar="N",
        help="shards at a time (default: 1; on a cluster: all)",
    )
    group.add_argument("--executor", choices=_EXECUTORS, help="where shards are made (default: local)")
    group.add_argument(
        "--shard-episodes",
        type=whole_number("--shard-episodes", None),
        metavar="N",
        help=f"in each (default: {SHARD_EPISODES})",
    )
    group.add_argument(
        "--shards", type=Path, metavar="FOLDER",
        help="keep shards and findings there (default: beside OUT, until it is complete)",
    )  # fmt: skip
    group.add_argument("--stats", action="store_true", help="compute meta/copolicy_stats.json, too")
    group.add_argument("--partition", help="of SLURM")
    group.add_argument("--time", metavar="HH:MM:SS", help="limit of a shard's SLURM job (default: 01:00:00)")
    group.add_argument("--memory-gb", type=whole_number("--memory-gb"), metavar="N", help="of a SLURM job (default: 4)")
    group.add_argument(
        "--setup", metavar="COMMAND", help="makes this environment active in a SLURM job (default: this virtual one)"
    )
    group.add_argument(
        "--sbatch", action="append", metavar="KEY=VALUE", help="further option of sbatch, such as account=lab"
    )


def asks_for_shards(arguments: argparse.Namespace) -> bool:
    """Whether a flag asks for shards, however many recordings there are."""
    asked = (arguments.executor, arguments.shard_episodes, arguments.shards, arguments.stats or None)
    return any(value is not None for value in asked)


def scale_of(arguments: argparse.Namespace) -> Scale | None:
    """The scale that the flags ask for, None where none of them asks for shards."""
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
    if asks_for_shards(arguments):
        if arguments.append:
            raise InvalidValueError("--append", "without shards, whose flags stand beside it", True)
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

    Shards that an earlier call finished are not made again, unless a recording in them changed.

    Returns:
        Summary of what was written, left out and found; for SLURM, of what was submitted.

    Raises:
        OutputExistsError: there is something at `root`.
        FileFormatError: no recordings, or a folder of shards that is none.
        InvalidValueError: the shards are those of another call.
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
    refusal = f"{folder}: expected shards that nobody works on, found another call at work"
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
        from .merge import merge_shards

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
