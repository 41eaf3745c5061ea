"""The two agents of a simulated pair with a seed of their own, whatever the episode's is."""

from copolicy.collect.agents import ScriptedAgent
from copolicy.tasks.table.agents import simulated_pair


def scripted_agents(seed: int, pair: str = "S01") -> tuple[ScriptedAgent, ScriptedAgent]:
    """Robot seat, human seat."""
    robot, human = (
        ScriptedAgent(f"scripted:{pair}", lambda seat, _, start: simulated_pair(start.scenario, pair, seed)[seat])
        for _ in range(2)
    )
    return robot, human
