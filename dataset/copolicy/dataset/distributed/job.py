"""A job: restartable tasks of one kind, and how one of them runs in a process."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from datatrove.executor.base import PipelineExecutor
from datatrove.pipeline.base import PipelineStep
from loguru import logger

from ..exceptions import CopolicyError, RunError


class Step(PipelineStep):
    """A pipeline step of datatrove that only writes files.

    Attributes:
        plan: what its `run` needs, the same for all ranks; pickled.
    """

    type = "copolicy"

    def __init__(self, plan: Any):
        super().__init__()
        self.plan = plan


@dataclass(frozen=True)
class Job:
    """Tasks of one kind: the ranks of a pipeline step.

    Attributes:
        step: does the task of a rank; a task whose output is complete does nothing.
        tasks: number of tasks.
        folder: where outputs are kept, for errors.
        logs: datatrove's folder: completion marks, logs, job scripts.
        noun: what the tasks are called, such as shards.
        finished: counts the finished tasks.
        threads: cores that a cluster reserves for a task.
        environment: variables of the processes that run tasks, other than the command's own.
    """

    step: Step
    tasks: int
    folder: Path
    logs: Path
    noun: str
    finished: Callable[[], int]
    threads: int = 1
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def progress(self) -> str:
        """Says how many tasks are finished, and where."""
        return f"{self.finished()} of {self.tasks} {self.noun} are finished and kept in {self.folder}"

    def killed(self) -> RunError:
        """The error for a process that was killed."""
        return RunError(
            f"{self.folder}: a process was killed, perhaps out of memory; {self.progress}: run the command again"
        )


def run_rank(executor: PipelineExecutor, rank: int) -> CopolicyError | None:
    """Runs a rank in this process; returns the error that we raise on purpose, if it does."""
    try:
        with quiet():
            executor._run_for_rank(rank, local_rank=rank)
    except CopolicyError as error:
        return error
    return None


@contextmanager
def quiet() -> Iterator[None]:
    """Disables datatrove's log, whose tracebacks repeat errors that are reported in one line elsewhere."""
    logger.disable("datatrove")
    try:
        yield
    finally:
        logger.enable("datatrove")
