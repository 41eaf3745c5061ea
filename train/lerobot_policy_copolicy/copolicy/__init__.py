"""The diffusion co-policy (Ng, Liu and Kennedy, 2023, arXiv 2305.12171) as a LeRobot policy."""

from .configuration_copolicy import CopolicyConfig

__all__ = ["CopolicyConfig"]
