"""Rollouts of two agents in a world, and the agents that can act at a seat.

    from copolicy.collect import make_agent, run_episodes

    robot = make_agent("policy:pretrained")
    episodes = run_episodes(robot, "scripted:stubborn", maps="unseen", limit=12)

Modules are imported when a name is first used.
"""

from typing import TYPE_CHECKING

from copolicy.dataset.lazy_names import lazy_names

if TYPE_CHECKING:
    from .agents.agent_names import make_agent
    from .agents.checkpoint_folder import load_policy
    from .agents.policy import Policy, PolicyAgent
    from .episodes import run_episodes
    from .rollout import Agent, Rollout, Trace

__all__ = ["Agent", "Policy", "PolicyAgent", "Rollout", "Trace", "load_policy", "make_agent", "run_episodes"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "load_policy": "agents.checkpoint_folder",
        "make_agent": "agents.agent_names",
        **dict.fromkeys(("Policy", "PolicyAgent"), "agents.policy"),
        "run_episodes": "episodes",
        **dict.fromkeys(("Agent", "Rollout", "Trace"), "rollout"),
    },
)
