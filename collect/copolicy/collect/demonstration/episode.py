"""An episode of a policy with a simulated partner, played without a clock: the same every time."""

from pathlib import Path
from typing import Any

from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.task import PairTask, get_task

from ..agents import Policy, PolicyAgent, ScriptedAgent
from ..replay.track import Track, track_of
from ..rollout import Rollout, Trace


def demonstrate(
    policy: Policy,
    scenario: Any,
    partner: str = "S01",
    seed: int = 0,
    settings: Any = None,
    task: PairTask | None = None,
) -> Track:
    """Lets a policy on the robot's seat and a simulated partner act to the end of the episode.

    Chunks come as in real time, but the world waits for each, so that the speed of the machine changes nothing.

    Args:
        policy: at the robot's seat.
        scenario: the map.
        partner: name of a simulated pair, whose human is the partner.
        seed: of the policy's noise and of the partner.
        settings: of the world; the usual ones if None.
        task: the table if None.

    Raises:
        InvalidValueError: the policy has learned another task.
    """
    task = task or get_task()
    robot, human = PolicyAgent(policy, task, real_time=True), ScriptedAgent.of_pair(partner, task)
    settings = settings or task.settings_type()
    try:
        rollout = Rollout(task, [scenario], (robot, human), seeds=[seed], settings=settings)
        trace = Trace(rollout)
        while len(rollout.running):
            robot.wait()
            rollout.step()
    finally:
        robot.close()
    name = task.name_of(scenario)
    (outcome,) = rollout.outcomes
    meta = EpisodeMeta(
        "",
        controller_0=robot.name,
        controller_1=human.name,
        **name.columns,
        seed=seed,
        source="simulated",
        success=outcome.success,
        termination_reason=outcome.reason,
    )
    states = task.states_of(trace.states(0))
    episode = Episode(states[:-1], trace.actions(0), states[-1], meta, scenario, settings=settings, task=task.spec.name)
    return track_of(Path(name.scenario), episode)
