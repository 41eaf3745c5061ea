"""The executors of datatrove that run a plan."""

import importlib.util
import shutil
import subprocess
import sys
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError, RunError

from ..lerobot.prepare import DamagedEpisodeError
from .local import LocalExecutor, quiet
from .pipeline import ConvertShard, MergeShards
from .plan import ShardPlan

try:
    from datatrove.executor import RayPipelineExecutor, SlurmPipelineExecutor
except ModuleNotFoundError as error:
    raise MissingExtraError((error.name or "datatrove").split(".")[0], "scale") from None

ExecutorName = Literal["local", "slurm", "ray"]


@dataclass(frozen=True)
class SlurmOptions:
    """What a cluster wants to know of a job.

    Attributes:
        time: limit of one shard's job, as sbatch takes it.
        memory_gb: of one job.
        setup: shell command that makes this environment active in a job; by default the virtual environment that
            runs now, which the nodes must see.
        arguments: further options of sbatch, for example `{"account": "lab"}`.
    """

    partition: str | None = None
    time: str = "01:00:00"
    memory_gb: int = 4
    setup: str | None = None
    arguments: tuple[tuple[str, str], ...] = ()


def require_executor(name: str, partition: str | None = None) -> None:
    """Checks that an executor can be used from here.

    Raises:
        InvalidValueError: Ray is not installed; no sbatch here, or no partition given.
    """
    if name == "ray" and importlib.util.find_spec("ray") is None:
        raise InvalidValueError("--executor", "local or slurm, as ray is not installed (pip install ray)", name)
    if name == "slurm":
        if shutil.which("sbatch") is None:
            raise InvalidValueError("--executor", "sbatch on the PATH, for slurm", "none")
        if not partition:
            raise InvalidValueError("--partition", "a partition of the cluster, for --executor slurm", partition)


def run_local(plan: ShardPlan, workers: int) -> None:
    """Makes all shards in processes of this machine.

    Raises:
        RunError: a process was killed, or shards hold damaged recordings; the other shards are finished.
    """
    executor = LocalExecutor([ConvertShard(plan)], len(plan), workers, str(plan.logs))
    try:
        with quiet():
            errors = executor.run()
    except BrokenProcessPool:
        raise RunError(
            f"{plan.folder}: a process was killed, perhaps for want of memory; {_finished(plan)}: run the same again"
        ) from None
    for error in errors:
        if not isinstance(error, DamagedEpisodeError):
            raise error
    if errors:
        raise _damage(plan)


def run_ray(plan: ShardPlan, workers: int | None) -> None:
    """Makes all shards on the Ray cluster that this process belongs to.

    Raises:
        RunError: not all shards were finished.
    """
    with quiet():
        executor = RayPipelineExecutor([ConvertShard(plan)], len(plan), workers or -1, logging_dir=str(plan.logs))
        executor.run()
    if executor.get_incomplete_ranks():
        raise _damage(plan)


def submit_slurm(plan: ShardPlan, workers: int | None, options: SlurmOptions) -> dict[str, Any]:
    """Hands an array of jobs, one for each unfinished shard, and a job that merges them afterwards to SLURM.

    Returns:
        Ids of the jobs; `shards` is None where every shard is finished.

    Raises:
        RunError: SLURM refused.
    """
    shards = _slurm(plan, [ConvertShard(plan)], len(plan), "copolicy-shards", plan.logs, options, workers or -1)
    # Without the last option a merge whose shards failed would wait in the queue for ever.
    merge = _slurm(
        plan, [MergeShards(plan)], 1, "copolicy-merge", plan.merge_logs, options, -1,
        depends=shards, more={"kill-on-invalid-dep": "yes"},
    )  # fmt: skip
    try:
        with quiet():
            merge.run()
    except subprocess.CalledProcessError as error:
        raise RunError(f"sbatch: expected it to take the job, found exit status {error.returncode}") from None
    return {"shards": None if shards.job_id in (None, -1) else shards.job_id, "merge": merge.job_id}


def _slurm(
    plan: ShardPlan, pipeline: list, tasks: int, name: str, logs: Path, options: SlurmOptions, workers: int,
    depends: SlurmPipelineExecutor | None = None, more: dict[str, str] | None = None,
) -> SlurmPipelineExecutor:  # fmt: skip
    activate = Path(sys.prefix) / "bin" / "activate"
    return SlurmPipelineExecutor(
        pipeline,
        tasks,
        options.time,
        str(options.partition),
        mem_per_cpu_gb=options.memory_gb,
        workers=workers,
        job_name=name,
        qos="",  # the cluster's own default; datatrove's "normal" is unknown to many
        env_command=options.setup or (f"source {activate}" if activate.is_file() else ""),
        sbatch_args={**dict(options.arguments), **(more or {})},
        depends=depends,
        logging_dir=str(logs),
    )


def _finished(plan: ShardPlan) -> str:
    done = sum(plan.record(rank) is not None for rank in range(len(plan)))
    return f"{done} of {len(plan)} shards are finished and kept in {plan.folder}"


def _damage(plan: ShardPlan) -> RunError:
    lists = [plan.damage_list(rank) for rank in range(len(plan))]
    lines = [line for path in lists if path.is_file() for line in path.read_text(encoding="utf-8").splitlines()]
    if not lines:
        return RunError(f"{plan.logs}: expected all jobs to end well, found others, see their logs; {_finished(plan)}")
    others = f" (and {len(lines) - 1} more, in {lists[0].parent})" if len(lines) > 1 else ""
    advice = "mend or remove such files, or add --skip-damaged, and run again"
    return RunError(f"{lines[0]}{others}; {_finished(plan)}: {advice}")
