"""Checks that every policy that acts frame by frame passes."""

from pathlib import Path

import numpy as np

from copolicy.collect.agents import PolicyAgent, load_policy
from copolicy.collect.rollout import Rollout
from copolicy.dataset.task import get_task


def require_acts_at_seat(run: Path, seat: int) -> None:
    """At the robot's seat it acts for both players, as in co-planning; at the human's beside another copy."""
    task, policy = get_task(), load_policy(run)
    agent = PolicyAgent(policy, task, seed=3)
    scenarios = task.scenario_sets["unseen"][:3]
    players = (agent, agent.human_half()) if seat == 0 else (PolicyAgent(load_policy(run), task, seed=4), agent)
    rollout = Rollout(task, scenarios, players, settings=task.settings_type(step_limit=30))
    rollout.run()
    assert agent.chunks.tolist() == [10, 10, 10]  # 30 steps of 30 Hz, 10 frames a second
    assert np.isfinite(rollout.actions).all()
