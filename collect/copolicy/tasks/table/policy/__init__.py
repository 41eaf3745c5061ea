"""What the table offers to policies beside the generic input. This folder alone imports torch; the task imports it late."""

from copolicy.dataset.task import PolicyFeatures

from .encoders import RelativeFeatures, ScanFeatures
from .symmetries import mirror_half, permute_obstacles

FEATURES = PolicyFeatures(
    encoders={"relative": RelativeFeatures, "scan": ScanFeatures},
    symmetries={"mirror": mirror_half, "permute_obstacles": permute_obstacles},
)
