"""The processors of the co-policy; LeRobot finds them by this name."""

from ..pair_policy.processor_pair import make_pair_pre_post_processors as make_copolicy_pre_post_processors

__all__ = ["make_copolicy_pre_post_processors"]
