"""datatrove's local executor, for processes that may be killed."""

import multiprocessing
import os
import signal
import threading
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from copolicy.dataset.commandline import progress
from copolicy.dataset.exceptions import CopolicyError, MissingExtraError

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
        # Spawned, not forked: a fork would copy the locks of whatever threads this process runs.
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(self.workers, len(ranks)), context, _start_worker) as pool:
            futures: list[Future[CopolicyError | None]] = [pool.submit(self._outcome, rank) for rank in ranks]
            try:
                done = progress(as_completed(futures), len(futures), "shards")
                return [error for future in done if (error := future.result())]
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

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


def _start_worker() -> None:
    # Ctrl-C reaches every process of a terminal: the workers leave it to the first one and finish their shard.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A process of a pool whose parent was killed would wait for its next task for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


__all__ = ["BrokenProcessPool", "LocalExecutor", "quiet"]
