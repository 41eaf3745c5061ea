"""What the table offers to policies beside the generic input: torch modules, imported by `TableTask.features` alone."""

from copolicy.dataset.task import PolicyFeatures

from .encoders import RelativeFeatures, ScanFeatures
from .symmetries import mirror_half, permute_obstacles

FEATURES = PolicyFeatures(
    encoders={"relative": RelativeFeatures, "scan": ScanFeatures},
    symmetries={"mirror": mirror_half, "permute_obstacles": permute_obstacles},
)
