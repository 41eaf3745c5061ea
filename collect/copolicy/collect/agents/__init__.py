"""Who can hold an end of the table: a person, a simulated player, an earlier recording, a policy.

Names are loaded when they are asked for: flags need none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .controller import Controller, Reading
    from .people import PersonController
    from .policy import PolicyController
    from .replay import ReplayController
    from .scripted import ScriptedController

__all__ = ["Controller", "PersonController", "PolicyController", "Reading", "ReplayController", "ScriptedController"]

_MODULES = {
    "Controller": "controller",
    "PersonController": "people",
    "PolicyController": "policy",
    "Reading": "controller",
    "ReplayController": "replay",
    "ScriptedController": "scripted",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
