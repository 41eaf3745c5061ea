"""The processors around Co-GAIL, found by LeRobot by their name."""

from ..pair_policy.processor_pair import make_pair_pre_post_processors as make_cogail_pre_post_processors

__all__ = ["make_cogail_pre_post_processors"]
