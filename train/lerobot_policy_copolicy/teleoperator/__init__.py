"""A pair of gamepads as one LeRobot teleoperator, `--teleop.type=copolicy_pair`."""

from .config_copolicy_pair import CopolicyPairConfig

__all__ = ["CopolicyPairConfig"]
