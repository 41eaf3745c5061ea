"""Runs ranks as tasks of a Ray cluster."""

import logging
import sys
from collections.abc import Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, redirect_stdout
from typing import Any

from datatrove.executor import RayPipelineExecutor

from ..command_line.commands import progress_bar
from ..exceptions import CopolicyError, InvalidValueError
from .flags import stated_address
from .job import Job, run_rank

RETRIES = 3
"""How often Ray runs a rank again whose process was killed."""


class RayExecutor(RayPipelineExecutor):
    """Runs each rank in a Ray task, with the completion marks and logs of its parent.

    The parent runs each rank in a `multiprocess.Pool` inside an actor; this pool waits forever for the rank of a killed
    process. Here Ray runs such a rank again, and a failed rank does not affect the others.
    """

    def __init__(self, job: Job, workers: int | None, address: str | None):
        """
        Args:
            workers: ranks at a time; all that the cluster has cores for if None.
            address: of the cluster; None for the one of this process, of `RAY_ADDRESS`, or of this machine.
        """
        super().__init__([job.step], job.tasks, workers or -1, logging_dir=str(job.logs), cpus_per_task=job.threads)
        self.noun, self.environment, self.address = job.noun, dict(job.environment), address

    def run(self) -> list[CopolicyError]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Runs the unfinished ranks.

        Returns:
            The errors of the failed ranks.

        Raises:
            BrokenProcessPool: the process of a rank was killed more than `RETRIES` times; the other ranks have ended.
            InvalidValueError: there is no cluster at the address.
        """
        ranks = self.get_incomplete_ranks()
        if not ranks:
            return []
        self.save_executor_as_json()
        with _cluster(self.address), progress_bar(len(ranks), self.noun) as bar:
            import ray  # pyright: ignore[reportMissingImports]
            from ray.exceptions import RayError, RayTaskError  # pyright: ignore[reportMissingImports]

            remote = ray.remote(run_rank).options(
                num_cpus=self.cpus_per_task,
                memory=int(self.mem_per_cpu_gb * self.cpus_per_task * 2**30),
                max_retries=RETRIES,
                runtime_env={"env_vars": self.environment} if self.environment else None,
            )
            executor = ray.put(self)
            running: list[Any] = []
            errors: list[CopolicyError] = []
            killed = False
            while ranks or running:
                while ranks and len(running) < self.workers:
                    running.append(remote.remote(executor, ranks.pop(0)))
                (done,), running = ray.wait(running, num_returns=1)
                try:
                    error = ray.get(done)
                except RayTaskError:  # an error in our code, not of a process
                    raise
                except RayError:
                    error, killed = None, True
                errors += [error] if error else []
                bar.update()
        if killed:
            raise BrokenProcessPool
        return errors


@contextmanager
def _cluster(address: str | None) -> Iterator[None]:
    """Connects to a cluster, unless this process is connected; what Ray prints goes to stderr."""
    import ray  # pyright: ignore[reportMissingImports]

    with redirect_stdout(sys.stderr):  # a message for each killed process
        if ray.is_initialized():
            yield
            return
        try:
            ray.init(address, log_to_driver=False, logging_level=logging.ERROR)
        except (ConnectionError, ValueError, RuntimeError) as error:
            stated = stated_address(address)
            if stated is None:
                raise
            name, place = stated
            found = f"{place}: {next(iter(str(error).splitlines()), type(error).__name__)}"
            raise InvalidValueError(name, "a Ray cluster that answers", found) from None
        try:
            yield
        finally:
            ray.shutdown()
