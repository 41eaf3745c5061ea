"""A pool of worker processes that ignore Ctrl-C and end with the command that started them."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any


class WorkerPool(ProcessPoolExecutor):
    """A pool of spawned processes that ignore SIGINT and end with the command.

    Ctrl-C sends SIGINT to every process of a terminal. Workers ignore it, also while they are still importing, and
    finish their current item; the command cancels the remaining items and reports the interruption. If the command
    is killed, its workers exit at once instead of waiting for their next item.

    Processes are spawned, not forked: a fork would copy the locks of the command's threads.
    """

    def __init__(self, workers: int, initializer: Callable[..., object] | None = None, initargs: tuple = ()):
        """
        Args:
            workers: number of processes.
            initializer: called in each process, with `initargs`.
        """
        super().__init__(workers, multiprocessing.get_context("spawn"), _start, (initializer, initargs))
        if hasattr(signal, "pthread_sigmask"):
            from multiprocessing import resource_tracker

            # Its start unblocks signals, so it must not start together with a worker.
            resource_tracker.ensure_running()

    def submit[**P, T](self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """See `ProcessPoolExecutor`, which starts its processes here."""
        with _sigint_blocked():
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, error_type: type[BaseException] | None, *_: Any) -> None:
        self.shutdown(cancel_futures=error_type is not None)


@contextmanager
def _sigint_blocked() -> Iterator[None]:
    """Blocks SIGINT until the end of the block; a process started in it inherits the block."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def _start(initializer: Callable[..., object] | None, initargs: tuple) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if initializer is not None:
        initializer(*initargs)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
