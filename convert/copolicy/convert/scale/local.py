"""datatrove's local executor, for processes that may be killed."""

from concurrent.futures import Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, MissingExtraError
from copolicy.dataset.worker_pool import WorkerPool

try:
    from datatrove.executor.local import LocalPipelineExecutor
    from loguru import logger
except ModuleNotFoundError as error:
    raise MissingExtraError((error.name or "datatrove").split(".")[0], "scale") from None


class LocalExecutor(LocalPipelineExecutor):
    """Runs ranks in processes of this machine, like its parent, with another pool.

    The parent's `multiprocess.Pool` waits for ever for the rank of a process that was killed, and terminates every
    rank at the first that fails. Here a killed process ends the run, and a rank that fails ends alone.
    """

    def run(self) -> list[CopolicyError]:
        """Runs the ranks that are not completed.

        Returns:
            The errors of those that failed.

        Raises:
            BrokenProcessPool: a process was killed.
        """
        ranks = self.get_incomplete_ranks()
        if not ranks:
            return []
        self.save_executor_as_json()
        if self.workers == 1:
            return [error for rank in progress(ranks, len(ranks), "shards") if (error := self._outcome(rank))]
        with WorkerPool(min(self.workers, len(ranks))) as pool:
            futures: list[Future[CopolicyError | None]] = [pool.submit(self._outcome, rank) for rank in ranks]
            done = progress(as_completed(futures), len(futures), "shards")
            return [error for future in done if (error := future.result())]

    def _outcome(self, rank: int) -> CopolicyError | None:
        try:
            with quiet():
                self._run_for_rank(rank, local_rank=rank)
        except CopolicyError as error:
            return error
        return None


@contextmanager
def quiet():
    """Keeps datatrove's log off the terminal: it shows its pipeline, paths and tracebacks of what is reported in one
    line elsewhere."""
    logger.disable("datatrove")
    try:
        yield
    finally:
        logger.enable("datatrove")


__all__ = ["BrokenProcessPool", "LocalExecutor", "quiet"]
