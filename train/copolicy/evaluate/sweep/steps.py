"""The tasks of a sweep as pipeline steps of datatrove."""

from copolicy.dataset.distributed.job import Job, Step

from .plan import NAME, SweepPlan


class RunTask(Step):
    """Runs one task per rank."""

    name = "run a task"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Runs task `rank` of the plan."""
        from .tasks import run_task  # torch

        run_task(self.plan, rank)


class Collect(Step):
    """Makes the table of the finished tasks."""

    name = "collect the results"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Writes the table into the folder of the plan."""
        from .collect import collect

        collect(self.plan.out)


def sweep_job(plan: SweepPlan) -> Job:
    """The tasks of a plan."""
    # Before a process loads its libraries: afterwards the variable changes nothing.
    environment = {"OMP_NUM_THREADS": str(plan.flags.threads)}
    return Job(
        RunTask(plan), len(plan.tasks), plan.out, plan.logs, "tasks", plan.finished, plan.flags.threads, environment
    )  # fmt: skip


def collect_job(plan: SweepPlan) -> Job:
    """The table of a plan."""
    return Job(Collect(plan), 1, plan.out, plan.collect_logs, f"{NAME}-table", lambda: 0)
