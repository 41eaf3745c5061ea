"""Studies of policies: co-planning, simulated partners, people, and paired comparisons with intervals.

    from copolicy.evaluate import compare_episodes, coplan_episodes, success

    small, paper = (coplan_episodes(run, "holdout") for run in ("outputs/small", "outputs/paper"))
    success(small), compare_episodes(small, paper)

Names are imported on first use.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .notebook import compare_episodes, coplan_episodes, success

__all__ = ["compare_episodes", "coplan_episodes", "success"]

__getattr__, __dir__ = lazy_names(__name__, dict.fromkeys(__all__, "notebook"))
