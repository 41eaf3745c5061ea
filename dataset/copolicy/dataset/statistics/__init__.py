"""Statistics of pair data: how multimodal a data set is, who leads, how hard the players press, and how sure that is.

Each family has a file; `compute.py` puts them together and `command.py` is `copolicy-dataset stats`.
"""

from .command import add_stats_command
from .estimate import Estimate, Null
from .trajectories import EpisodeRow, Trajectories

__all__ = ["EpisodeRow", "Estimate", "Null", "Trajectories", "add_stats_command"]
