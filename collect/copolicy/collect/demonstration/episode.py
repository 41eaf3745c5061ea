"""An episode of a policy with a simulated partner, played without a clock: the same every time."""

from pathlib import Path

import numpy as np

from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.task import RUNNING, get_task
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.world import TableWorld

from ..agents import PolicyController, ScriptedController
from ..agents.policy import JointPlanner
from ..replay.track import Track, track_of


def demonstrate(
    planner: JointPlanner, map_config: MapConfig, partner: str = "S01", seed: int = 0, physics: Physics | None = None
) -> Track:
    """Lets a policy on the robot's seat and a simulated partner carry the table to the end of the episode.

    The world waits for each plan, so that the speed of the machine changes nothing.

    Args:
        planner: the policy.
        map_config: the map.
        partner: name of a simulated pair, whose human is the partner.
        seed: of the plans' noise and of the partner.
        physics: of the world; the usual one if None.
    """
    robot, human = PolicyController(planner), ScriptedController(partner)
    physics = physics or Physics()
    world = TableWorld(map_config, physics)
    states, actions = [], []
    try:
        for seat, controller in enumerate((robot, human)):
            controller.begin(seat, map_config, seed)
        outcome = RUNNING
        while not outcome.done:
            robot.wait()
            state = world.observation
            forces = [controller.read(state).force for controller in (robot, human)]
            action = np.clip(np.concatenate(forces), -1.0, 1.0)
            states.append(state)
            actions.append(action)
            outcome = world.step(action)
            for controller in (robot, human):
                controller.executed(action)
    finally:
        robot.close()
    name = get_task().name_of(map_config)
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
    episode = Episode(np.array(states), np.array(actions), world.observation, meta, map_config, settings=physics)
    return track_of(Path(name.scenario), episode)
