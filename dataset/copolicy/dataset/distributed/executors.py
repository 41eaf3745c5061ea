"""Runs the tasks of a job in local processes, on Ray, or as SLURM jobs, each finished task once."""

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from datatrove.executor import LocalPipelineExecutor, SlurmPipelineExecutor

from ..command_line.commands import progress
from ..exceptions import CopolicyError, RunError
from ..worker_pool import WorkerPool
from .flags import Distribution
from .job import Job, quiet, run_rank


def run_tasks(job: Job, distribution: Distribution) -> list[CopolicyError]:
    """Runs the unfinished tasks in local processes or on Ray, and waits for them.

    Returns:
        The errors of the failed tasks, which do not affect the others.

    Raises:
        RunError: a process was killed (on Ray: again and again); finished tasks are kept.
        InvalidValueError: there is no Ray cluster at the address.
    """
    if distribution.executor == "ray":
        from .ray_executor import RayExecutor

        executor: Any = RayExecutor(job, distribution.workers, distribution.address)
    else:
        executor = LocalExecutor(job, distribution.workers or 1)
    try:
        with quiet():
            return executor.run()
    except BrokenProcessPool:
        if job.finished() < job.tasks:
            raise job.killed() from None
        return []  # killed after its last task


def submit_slurm(job: Job, last: Job, distribution: Distribution) -> dict[str, Any]:
    """Submits an array of SLURM jobs, one per unfinished task, and a job that runs after all of them.

    Args:
        last: one task, which needs the output of `job`.

    Returns:
        Ids of the jobs by the noun of each; None for `job` if every task is finished.

    Raises:
        RunError: sbatch failed.
    """
    tasks = _slurm(job, distribution)
    # Without kill-on-invalid-dep, a last job whose tasks failed would stay in the queue forever.
    after = _slurm(last, Distribution(slurm=distribution.slurm), tasks, {"kill-on-invalid-dep": "yes"})
    try:
        with quiet():
            after.run()
    except subprocess.CalledProcessError as error:
        raise RunError(f"sbatch: expected it to take the job, found exit status {error.returncode}") from None
    return {job.noun: None if tasks.job_id in (None, -1) else tasks.job_id, last.noun: after.job_id}


def _slurm(
    job: Job, distribution: Distribution, depends: SlurmPipelineExecutor | None = None,
    extra_arguments: Mapping[str, str] | None = None,
) -> SlurmPipelineExecutor:  # fmt: skip
    options, activate = distribution.slurm, Path(sys.prefix) / "bin" / "activate"
    setup = options.setup or (f"source {shlex.quote(str(activate))}" if activate.is_file() else "")
    exports = [f"export {name}={shlex.quote(value)}" for name, value in job.environment.items()]
    return SlurmPipelineExecutor(
        [job.step],
        job.tasks,
        options.time,
        str(options.partition),
        cpus_per_task=job.threads,
        mem_per_cpu_gb=-(-options.memory_gb // job.threads),
        workers=distribution.workers or -1,
        job_name=f"copolicy-{job.noun}",
        qos="",  # the cluster's own default; datatrove's "normal" is unknown to many
        env_command="; ".join(filter(None, (*exports, setup))),
        sbatch_args={**dict(options.arguments), **(extra_arguments or {})},
        depends=depends,
        logging_dir=str(job.logs),
    )


class LocalExecutor(LocalPipelineExecutor):
    """Runs ranks in local processes, like its parent, with another pool.

    The parent's `multiprocess.Pool` waits forever for the rank of a killed process, and terminates all ranks when one
    fails. Here a killed process ends the run, and a failed rank does not affect the others.
    """

    def __init__(self, job: Job, workers: int):
        super().__init__([job.step], job.tasks, workers, str(job.logs))
        self.noun = job.noun
        self.environment = dict(job.environment)

    def run(self) -> list[CopolicyError]:
        """Runs the unfinished ranks, in this process if there is one worker.

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
            return [error for rank in progress(ranks, len(ranks), self.noun) if (error := run_rank(self, rank))]
        with _variables(self.environment), WorkerPool(min(self.workers, len(ranks))) as pool:
            futures: list[Future[CopolicyError | None]] = [pool.submit(run_rank, self, rank) for rank in ranks]
            done = progress(as_completed(futures), len(futures), self.noun)
            return [error for future in done if (error := future.result())]


@contextmanager
def _variables(environment: Mapping[str, str]) -> Iterator[None]:
    """Sets environment variables, which processes that start in the block inherit."""
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
