"""Two players carry a table past obstacles to a goal (Ng, Liu and Kennedy, RA-L 2023).

Modules are imported when a name is first used: command-line flags need the maps, but neither pymunk nor scipy.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .map_config import MAX_OBSTACLES, WINDOW, MapConfig
    from .maps import MAP_SETS, ORIGINAL_MAPS, identify, map_set
    from .physics import GOAL_SIZE, Physics
    from .task import TableTask
    from .world import TableWorld

__all__ = [
    "GOAL_SIZE",
    "MAP_SETS",
    "MAX_OBSTACLES",
    "ORIGINAL_MAPS",
    "WINDOW",
    "MapConfig",
    "Physics",
    "TableTask",
    "TableWorld",
    "identify",
    "map_set",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        **dict.fromkeys(("MAX_OBSTACLES", "WINDOW", "MapConfig"), "map_config"),
        **dict.fromkeys(("MAP_SETS", "ORIGINAL_MAPS", "identify", "map_set"), "maps"),
        **dict.fromkeys(("GOAL_SIZE", "Physics"), "physics"),
        "TableTask": "task",
        "TableWorld": "world",
    },
)
