"""Runs a shard plan with the executors of `copolicy.dataset.distributed`."""

from typing import Any

from copolicy.dataset.distributed.executors import run_tasks, submit_slurm
from copolicy.dataset.distributed.flags import Distribution
from copolicy.dataset.distributed.job import Job, Step
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.files.staging import replace_json

from ..lerobot.prepare import DamagedEpisodeError
from .shard_plan import ShardPlan

SUMMARY_FILE = "summary.json"


class ConvertShard(Step):
    """Converts one shard per rank."""

    name = "convert a shard"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Converts shard `rank` of the plan."""
        from .shard import convert_shard

        self.stat_update("episodes", value=convert_shard(self.plan, rank))


class MergeShards(Step):
    """Merges all shards to one data set; writes the summary beside the shards."""

    name = "merge the shards"

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Writes the data set of the plan."""
        from .merge_shards import merge_shards

        summary = merge_shards(self.plan)
        replace_json(self.plan.folder / SUMMARY_FILE, summary)


def convert_shards(plan: ShardPlan, distribution: Distribution) -> None:
    """Converts all shards in local processes or on Ray.

    Raises:
        RunError: a process was killed, or shards hold damaged recordings; finished shards are kept.
    """
    errors = run_tasks(job := _conversion(plan), distribution)
    for error in errors:
        if not isinstance(error, DamagedEpisodeError):
            raise error
    if errors:
        raise _damage_error(plan, job, errors)


def submit_shards(plan: ShardPlan, distribution: Distribution) -> dict[str, Any]:
    """Submits an array of SLURM jobs, one per unfinished shard, and a job that merges the shards afterwards.

    Returns:
        Ids of the jobs; `shards` is None if every shard is finished.

    Raises:
        RunError: sbatch failed.
    """
    merge = Job(MergeShards(plan), 1, plan.folder, plan.merge_logs, "merge", lambda: 0)
    return submit_slurm(_conversion(plan), merge, distribution)


def _conversion(plan: ShardPlan) -> Job:
    def finished() -> int:
        return sum(plan.record(rank) is not None for rank in range(len(plan)))

    return Job(ConvertShard(plan), len(plan), plan.folder, plan.logs, "shards", finished)


def _damage_error(plan: ShardPlan, job: Job, errors: list) -> RunError:
    lists = [plan.damage_list(rank) for rank in range(len(plan))]
    lines = [line for path in lists if path.is_file() for line in path.read_text(encoding="utf-8").splitlines()]
    lines = lines or [str(error) for error in errors]
    more_lines = f" (and {len(lines) - 1} more, in {lists[0].parent})" if len(lines) > 1 else ""
    advice = "repair or remove such files, or add --skip-damaged, and run again"
    return RunError(f"{lines[0]}{more_lines}; {job.progress}: {advice}")
