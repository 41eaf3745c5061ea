"""The design of a human study: robots, starts and set-ups of each participant's trials, counterbalanced."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError

from .plan import PlannedTrial, Robot, StudyPlan, plan_digest


def make_plan(
    robots: Sequence[Robot],
    maps: str,
    configurations: Sequence[Any],
    participants: int,
    episodes_per_robot: int,
    seed: int,
    fronts: Sequence[str] = (),
    **settings: Any,
) -> StudyPlan:
    """Makes the plan of a within-subject study.

    Each participant has one block of `episodes_per_robot` episodes with each robot, on the same starts, so that robots
    are compared within a person on equal starts and can be rated one by one. The order of robots follows a Williams
    design over participants. Starts are dealt to participants in turn and shuffled in each block.

    With set-ups (`fronts`) each start comes in every set-up: a block has one part for each, on the same starts. Which
    set-up is first alternates from block to block, and begins with the second one in every second round of the Williams
    design: each robot has each set-up first equally often, at every place of the order.

    Args:
        configurations: starts; with set-ups in each of them, one start after the other.
        fronts: set-ups, see `Studies.fronts`; none if empty.
        settings: further fields of the plan.

    Raises:
        InvalidValueError: fewer than two robots, equal names, no participant, more episodes than starts, or a number of
            episodes that is no multiple of the set-ups.
    """
    names = [robot.name for robot in robots]
    if len(names) < 2 or len(set(names)) < len(names):
        raise InvalidValueError("CKPT", "at least two robots of different names", names)
    if participants < 1:
        raise InvalidValueError("--participants", "at least 1", participants)
    parts = fronts or ("",)
    if not 1 <= episodes_per_robot <= len(configurations) or episodes_per_robot % len(parts):
        multiple = f", a multiple of {len(parts)}" if fronts else ""
        raise InvalidValueError("--episodes-per-robot", f"1 to {len(configurations)}{multiple}", episodes_per_robot)
    rng = np.random.default_rng(seed)
    shuffled = [names[k] for k in rng.permutation(len(names))]
    square = williams_square(len(names))
    trials: dict[str, tuple[PlannedTrial, ...]] = {}
    bases, own_count = len(configurations) // len(parts), episodes_per_robot // len(parts)
    for person in range(participants):
        own = [(person * own_count + k) % bases for k in range(own_count)]
        planned: list[PlannedTrial] = []
        for block, robot in enumerate(square[person % len(square)], 1):
            first = (person // len(square) + block - 1) % len(parts)
            for front in (*range(first, len(parts)), *range(first)):
                for k in rng.permutation(len(own)):
                    code = f"B{block}T{len(planned) + 1:02d}"
                    configuration = own[int(k)] * len(parts) + front
                    planned.append(PlannedTrial(code, block, shuffled[robot], configuration, parts[front]))
        trials[f"P{person + 1:02d}"] = tuple(planned)
    plan = StudyPlan("", maps, tuple(robots), tuple(configurations), trials, seed, **settings)
    return StudyPlan(**{**vars(plan), "plan_id": plan_digest(plan)})


def williams_square(count: int) -> list[list[int]]:
    """Williams' design (1949): each row is an order of `count` conditions, used by participants in turn.

    An even `count` gives `count` rows; an odd one gives these and their reversals.
    """
    first = [0]
    low, high = 1, count - 1
    while len(first) < count:
        first.append(low if len(first) % 2 else high)
        low, high = (low + 1, high) if len(first) % 2 == 0 else (low, high - 1)
    square = [[(condition + row) % count for condition in first] for row in range(count)]
    return square if count % 2 == 0 or count == 1 else square + [row[::-1] for row in square]
