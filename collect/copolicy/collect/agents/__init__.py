"""Who can act at a seat: a person, a simulated player, an earlier recording, a policy.

Names are loaded when they are asked for: flags need none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .checkpoint_folder import load_policy
    from .people import PersonAgent
    from .policy import Policy, PolicyAgent
    from .replay import HeldAgent, RecordedAgent, ReplayAgent
    from .scripted import ScriptedAgent

__all__ = [
    "HeldAgent",
    "PersonAgent",
    "Policy",
    "PolicyAgent",
    "RecordedAgent",
    "ReplayAgent",
    "ScriptedAgent",
    "load_policy",
]

_MODULES = {
    **dict.fromkeys(("HeldAgent", "RecordedAgent", "ReplayAgent"), "replay"),
    **dict.fromkeys(("Policy", "PolicyAgent"), "policy"),
    "PersonAgent": "people",
    "ScriptedAgent": "scripted",
    "load_policy": "checkpoint_folder",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)
