"""The loop: all tables side by side, thirty steps a second, one call of the policy for all of them a frame."""

from collections.abc import Callable, Sequence

from copolicy.dataset.clock import stride
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics

from .outcome import PartnerOutcome
from .robots import Robot
from .table import PartnerTable


def carry_with_partners(
    robot: Robot,
    maps: Sequence[MapConfig],
    partners: Sequence[str],
    physics: Physics,
    *,
    repeats: int = 1,
    fps: int = 10,
    seed: int = 0,
    partner_seed: int = 0,
    on_frame: Callable[[int], object] = lambda finished: None,
) -> list[PartnerOutcome]:
    """Lets a robot carry the table with every kind of partner from every start.

    Protocol (paper, section V-B): the robot plans at every frame, from the last frames' observations, of which the
    newest is the present one; it holds the first action for 30 / fps steps. The partner acts at every step. The
    world waits for a plan, which on a real clock would come a little later.

    Args:
        repeats: partners of each kind on each start, with different random numbers.
        fps: rate of the data set that the policy was trained on.
        seed: of the robot's random numbers.
        partner_seed: of the partners'; equal ones give every robot the same partners.
        on_frame: called after each frame with the number of finished episodes.

    Returns:
        One outcome for each map, kind and repeat, in that order.
    """
    steps = stride(fps)
    tables = [
        PartnerTable(index, config, partner, repeat, physics, partner_seed, robot.frames)
        for index, config in enumerate(maps)
        for partner in partners
        for repeat in range(repeats)
    ]
    robot.begin(tables, seed)
    frame = 0
    while running := [table for table in tables if table.running]:
        for step in range(steps):
            running = [table for table in running if table.running]
            for table, force in zip(running, robot.act(running, frame, begins=step == 0), strict=True):
                table.step(force)
        for table in running:
            if table.running:
                table.end_frame(steps, fps)
        frame += 1
        on_frame(sum(not table.running for table in tables))
    return [table.outcome() for table in tables]
