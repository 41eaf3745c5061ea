"""The processors around the VRNN planner, found by LeRobot by their name."""

from ..pair_policy.processor_pair import make_pair_pre_post_processors as make_vrnn_pre_post_processors

__all__ = ["make_vrnn_pre_post_processors"]
