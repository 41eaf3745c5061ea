"""Who can act at a seat: a person, a simulated player, an earlier recording, a policy.

Names are loaded when they are asked for: flags need none of them.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        **dict.fromkeys(("HeldAgent", "RecordedAgent", "ReplayAgent"), "replay"),
        **dict.fromkeys(("Policy", "PolicyAgent"), "policy"),
        "PersonAgent": "people",
        "ScriptedAgent": "scripted",
        "load_policy": "checkpoint_folder",
    },
)
