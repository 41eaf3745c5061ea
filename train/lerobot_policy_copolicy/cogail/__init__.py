"""Co-GAIL (Wang et al., CoRL 2021, arXiv 2108.06038) as a LeRobot policy; `copolicy-train cogail` trains it."""

from .configuration_cogail import CoGailConfig

__all__ = ["CoGailConfig"]
