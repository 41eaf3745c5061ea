"""Statistics of pair data with confidence intervals and null distributions: multimodality, leadership, forces, ...

One family per module; `compute.py` runs them all, `command.py` is `copolicy-dataset stats`.
"""

from .command import add_stats_command
from .estimate import Estimate, Null
from .trajectories import EpisodeRow, Trajectories

__all__ = ["EpisodeRow", "Estimate", "Null", "Trajectories", "add_stats_command"]
