"""Agents that act at a seat: a person, a scripted player, an earlier recording, a policy.

Modules are imported when a name is first used, since command-line flags need none of them.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .checkpoint_folder import load_policy
    from .composed import AgentsByWorld, RandomAgent
    from .human_limits import HumanLimits, LimitedAgent
    from .people import PersonAgent
    from .policy import Policy, PolicyAgent
    from .policy_process import PolicyProcess
    from .replay import ConstantAgent, RecordedAgent, ReplayAgent
    from .scripted import ScriptedAgent

__all__ = [
    "AgentsByWorld",
    "ConstantAgent",
    "HumanLimits",
    "LimitedAgent",
    "PersonAgent",
    "Policy",
    "PolicyAgent",
    "PolicyProcess",
    "RandomAgent",
    "RecordedAgent",
    "ReplayAgent",
    "ScriptedAgent",
    "load_policy",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        **dict.fromkeys(("ConstantAgent", "RecordedAgent", "ReplayAgent"), "replay"),
        **dict.fromkeys(("Policy", "PolicyAgent"), "policy"),
        **dict.fromkeys(("AgentsByWorld", "RandomAgent"), "composed"),
        **dict.fromkeys(("HumanLimits", "LimitedAgent"), "human_limits"),
        "PersonAgent": "people",
        "PolicyProcess": "policy_process",
        "ScriptedAgent": "scripted",
        "load_policy": "checkpoint_folder",
    },
)
