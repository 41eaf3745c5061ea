"""Processes of a command that share its work, and what a stop or the death of the command means to them."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any


class WorkerPool(ProcessPoolExecutor):
    """A pool of spawned processes that leave Ctrl-C to the command and end with it.

    Ctrl-C reaches every process of a terminal. A worker does not hear it, not even while it is still importing, and
    finishes what it has begun; the command cancels the rest and ends in its own line. Where the command itself is
    killed, its workers, which would wait for their next task for ever, end at once.

    Spawned, not forked: a fork would copy the locks of whatever threads the command runs.
    """

    def __init__(self, workers: int, initializer: Callable[..., object] | None = None, initargs: tuple = ()):
        """
        Args:
            workers: how many processes.
            initializer: called in each of them, with `initargs`.
        """
        super().__init__(workers, multiprocessing.get_context("spawn"), _start, (initializer, initargs))
        if hasattr(signal, "pthread_sigmask"):
            from multiprocessing import resource_tracker

            # It lets signals through again when it starts itself, so not while a worker is being started.
            resource_tracker.ensure_running()

    def submit[**P, T](self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """See `ProcessPoolExecutor`, which starts its processes here."""
        with _interrupts_held_back():
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, kind: type[BaseException] | None, *_: Any) -> None:
        self.shutdown(cancel_futures=kind is not None)


@contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C waits until the end of the block; a process that starts in it never hears of one."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


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
