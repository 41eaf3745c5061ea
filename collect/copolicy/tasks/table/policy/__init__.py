"""Observation encoders and symmetries of the table for policies; torch, imported by `TableTask.features` only."""

from copolicy.dataset.task import PolicyFeatures

from .encoders import RelativeFeatures, ScanFeatures
from .symmetries import mirror_half, permute_obstacles

POLICY_FEATURES = PolicyFeatures(
    encoders={"relative": RelativeFeatures, "scan": ScanFeatures},
    symmetries={"mirror": mirror_half, "permute_obstacles": permute_obstacles},
)
