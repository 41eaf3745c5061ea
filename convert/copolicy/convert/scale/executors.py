"""Runs a shard plan with the executors of datatrove."""

import importlib.util
import shutil
import subprocess
import sys
from concurrent.futures import Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from datatrove.executor import LocalPipelineExecutor, RayPipelineExecutor, SlurmPipelineExecutor
from datatrove.pipeline.base import PipelineStep
from loguru import logger

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.files.staging import replace_json
from copolicy.dataset.worker_pool import WorkerPool

from ..lerobot.prepare import DamagedEpisodeError
from .shard_plan import ShardPlan

SUMMARY_FILE = "summary.json"


class _Step(PipelineStep):
    """A pipeline step of datatrove that only writes files."""

    type = "copolicy"

    def __init__(self, plan: ShardPlan):
        super().__init__()
        self.plan = plan


class ConvertShard(_Step):
    """Converts one shard per rank."""

    name = "convert a shard"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Converts shard `rank` of the plan."""
        from .shard import convert_shard

        self.stat_update("episodes", value=convert_shard(self.plan, rank))


class MergeShards(_Step):
    """Merges all shards to one data set; writes the summary beside the shards."""

    name = "merge the shards"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Writes the data set of the plan."""
        from .merge_shards import merge_shards

        summary = merge_shards(self.plan)
        replace_json(self.plan.folder / SUMMARY_FILE, summary)


@dataclass(frozen=True)
class SlurmOptions:
    """Options of SLURM jobs.

    Attributes:
        time: time limit of one shard's job, in sbatch's format.
        memory_gb: memory of one job.
        setup: shell command that activates the environment in a job; by default activates the current virtual
            environment, which must be visible to the nodes.
        arguments: further options of sbatch, for example `(("account", "lab"),)`.
    """

    partition: str | None = None
    time: str = "01:00:00"
    memory_gb: int = 4
    setup: str | None = None
    arguments: tuple[tuple[str, str], ...] = ()


def require_executor(name: str, partition: str | None = None) -> None:
    """Checks that an executor is usable on this machine.

    Raises:
        InvalidValueError: Ray is not installed, sbatch is not found, or no partition is given.
    """
    if name == "ray" and importlib.util.find_spec("ray") is None:
        raise InvalidValueError("--executor", "local or slurm, as ray is not installed (pip install ray)", name)
    if name == "slurm":
        if shutil.which("sbatch") is None:
            raise InvalidValueError("--executor", "sbatch on the PATH, for slurm", "none")
        if not partition:
            raise InvalidValueError("--partition", "a partition of the cluster, for --executor slurm", partition)


def run_local(plan: ShardPlan, workers: int) -> None:
    """Converts all shards in local processes.

    Raises:
        RunError: a process was killed, or shards hold damaged recordings; finished shards are kept.
    """
    executor = LocalExecutor([ConvertShard(plan)], len(plan), workers, str(plan.logs))
    try:
        with quiet():
            errors = executor.run()
    except BrokenProcessPool:
        raise RunError(
            f"{plan.folder}: a process was killed, perhaps out of memory; {_progress_text(plan)}: run the command again"
        ) from None
    for error in errors:
        if not isinstance(error, DamagedEpisodeError):
            raise error
    if errors:
        raise _damage_error(plan)


def run_ray(plan: ShardPlan, workers: int | None) -> None:
    """Converts all shards on the Ray cluster of this process.

    Raises:
        RunError: not all shards were finished.
    """
    with quiet():
        executor = RayPipelineExecutor([ConvertShard(plan)], len(plan), workers or -1, logging_dir=str(plan.logs))
        executor.run()
    if executor.get_incomplete_ranks():
        raise _damage_error(plan)


def submit_slurm(plan: ShardPlan, workers: int | None, options: SlurmOptions) -> dict[str, Any]:
    """Submits an array of SLURM jobs, one per unfinished shard, and a job that merges the shards afterwards.

    Returns:
        Ids of the jobs; `shards` is None if every shard is finished.

    Raises:
        RunError: sbatch failed.
    """
    shards = _slurm(plan, [ConvertShard(plan)], len(plan), "copolicy-shards", plan.logs, options, workers or -1)
    # Without kill-on-invalid-dep, a merge whose shards failed would stay in the queue forever.
    merge = _slurm(
        plan, [MergeShards(plan)], 1, "copolicy-merge", plan.merge_logs, options, -1,
        depends=shards, extra_arguments={"kill-on-invalid-dep": "yes"},
    )  # fmt: skip
    try:
        with quiet():
            merge.run()
    except subprocess.CalledProcessError as error:
        raise RunError(f"sbatch: expected it to take the job, found exit status {error.returncode}") from None
    return {"shards": None if shards.job_id in (None, -1) else shards.job_id, "merge": merge.job_id}


def _slurm(
    plan: ShardPlan, pipeline: list, tasks: int, name: str, logs: Path, options: SlurmOptions, workers: int,
    depends: SlurmPipelineExecutor | None = None, extra_arguments: dict[str, str] | None = None,
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
        sbatch_args={**dict(options.arguments), **(extra_arguments or {})},
        depends=depends,
        logging_dir=str(logs),
    )


def _progress_text(plan: ShardPlan) -> str:
    done = sum(plan.record(rank) is not None for rank in range(len(plan)))
    return f"{done} of {len(plan)} shards are finished and kept in {plan.folder}"


def _damage_error(plan: ShardPlan) -> RunError:
    lists = [plan.damage_list(rank) for rank in range(len(plan))]
    lines = [line for path in lists if path.is_file() for line in path.read_text(encoding="utf-8").splitlines()]
    if not lines:
        return RunError(
            f"{plan.logs}: expected all jobs to succeed, found failed ones, see their logs; {_progress_text(plan)}"
        )
    more_lines = f" (and {len(lines) - 1} more, in {lists[0].parent})" if len(lines) > 1 else ""
    advice = "repair or remove such files, or add --skip-damaged, and run again"
    return RunError(f"{lines[0]}{more_lines}; {_progress_text(plan)}: {advice}")


class LocalExecutor(LocalPipelineExecutor):
    """Runs ranks in local processes, like its parent, with another pool.

    The parent's `multiprocess.Pool` waits forever for the rank of a killed process, and terminates all ranks when one
    fails. Here a killed process ends the run, and a failed rank does not affect the others.
    """

    def run(self) -> list[CopolicyError]:
        """Runs the unfinished ranks.

        Returns:
            The errors of the failed ranks.

        Raises:
            BrokenProcessPool: a process was killed.
        """
        ranks = self.get_incomplete_ranks()
        if not ranks:
            return []
        self.save_executor_as_json()
        if self.workers == 1:
            return [error for rank in progress(ranks, len(ranks), "shards") if (error := self._run_rank(rank))]
        with WorkerPool(min(self.workers, len(ranks))) as pool:
            futures: list[Future[CopolicyError | None]] = [pool.submit(self._run_rank, rank) for rank in ranks]
            done = progress(as_completed(futures), len(futures), "shards")
            return [error for future in done if (error := future.result())]

    def _run_rank(self, rank: int) -> CopolicyError | None:
        try:
            with quiet():
                self._run_for_rank(rank, local_rank=rank)
        except CopolicyError as error:
            return error
        return None


@contextmanager
def quiet():
    """Disables datatrove's log, whose tracebacks repeat errors that are reported in one line elsewhere."""
    logger.disable("datatrove")
    try:
        yield
    finally:
        logger.enable("datatrove")
