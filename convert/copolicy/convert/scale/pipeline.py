"""The two steps as datatrove runs them."""

from copolicy.dataset.exceptions import MissingExtraError
from copolicy.dataset.files.staging import replace_json

from .plan import ShardPlan

try:
    from datatrove.pipeline.base import PipelineStep
except ModuleNotFoundError as error:
    raise MissingExtraError((error.name or "datatrove").split(".")[0], "scale") from None

SUMMARY_FILE = "summary.json"


class ConvertShard(PipelineStep):
    """One shard a rank; its only output are files."""

    type = "copolicy"
    name = "convert a shard"

    def __init__(self, plan: ShardPlan):
        super().__init__()
        self.plan = plan

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Makes shard `rank` of the plan."""
        from .shard import convert_shard

        self.stat_update("episodes", value=convert_shard(self.plan, rank))


class MergeShards(PipelineStep):
    """All shards to one data set, in a job of its own; the summary is kept beside the shards."""

    type = "copolicy"
    name = "merge the shards"

    def __init__(self, plan: ShardPlan):
        super().__init__()
        self.plan = plan

    def run(self, data=None, rank: int = 0, world_size: int = 1) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Makes the data set of the plan."""
        from .merge import merge_shards

        summary = merge_shards(self.plan)
        replace_json(self.plan.folder / SUMMARY_FILE, summary)
