"""Two players carry a table past obstacles to a goal (Ng, Liu and Kennedy, RA-L 2023).

Names are loaded when they are asked for: flags need the maps, but neither pymunk nor what finds routes.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

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

_MODULES = {
    **dict.fromkeys(("MAX_OBSTACLES", "WINDOW", "MapConfig"), "map_config"),
    **dict.fromkeys(("MAP_SETS", "ORIGINAL_MAPS", "identify", "map_set"), "maps"),
    **dict.fromkeys(("GOAL_SIZE", "Physics"), "physics"),
    "TableTask": "task",
    "TableWorld": "world",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
