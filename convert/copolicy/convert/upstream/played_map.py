"""Checks whether the stored map is the one that was played, and recovers it if not.

The original's `process_data*.py` choose map files by substring, so ep_1 may get the map of ep_10 or ep_11.
"""

from dataclasses import dataclass, replace

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import ORIGINAL_MAPS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.reward import reward
from copolicy.tasks.table.world import TableWorld

from .build_episode import outcome, start_pose

_START_TOLERANCE = 1.0  # px
_REWARD_TOLERANCE = 2e-6  # rewards were computed from, and stored as, single precision
_TOUCHING_ROWS = 3  # rows that may graze a solid where the contact test and the original disagree


@dataclass(frozen=True)
class MapFinding:
    """The map to use, with its quality flags and notes."""

    config: MapConfig
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def rounded(config: MapConfig) -> MapConfig:
    """Rounds a map to remove the noise of single precision: positions to 0.001 px, the orientation to 0.00001 rad."""
    (x, y, theta), goal = config.start, config.goal
    obstacles = tuple((round(cx, 3), round(cy, 3)) for cx, cy in config.obstacles)
    start = (round(x, 3), round(y, 3), round(theta, 5))
    return replace(config, start=start, goal=(round(goal[0], 3), round(goal[1], 3)), obstacles=obstacles)


def start_differs(config: MapConfig, first_state: Array) -> str:
    """Describes the distance of the map's start from the first state `(6,)`; empty if within tolerance."""
    distance = float(np.hypot(*(np.asarray(config.start[:2]) - first_state[:2])))
    return f"its start is {distance:.0f} px from the path's" if distance > _START_TOLERANCE else ""


def check_by_rewards(stored: MapConfig, first_state: Array, positions: Array, rewards: Array) -> MapFinding:
    """Compares the stored map with the rewards at the positions `(T, 2)` after each action; recovers the played one.

    The rewards were computed on the map that was played. Of the known maps that give these rewards, the one with the
    fewest obstacles is used; an obstacle at least 270 px from the path does not affect the rewards.
    """
    reason = start_differs(stored, first_state)
    error = _reward_error(stored, positions, rewards)
    if error > _REWARD_TOLERANCE:
        reason = reason or f"its rewards are up to {error:.2g} from the stored ones"
    if not reason:
        return MapFinding(stored)
    restarted = replace(stored, start=start_pose(first_state))
    fits = [
        config for config in _candidates(restarted) if _reward_error(config, positions, rewards) <= _REWARD_TOLERANCE
    ]
    if not fits:
        note = (
            f"stored map is not the one played: {reason}; no known map gives the rewards, goal and obstacles unchanged"
        )
        return MapFinding(restarted, ("map_mismatch",), (note,))
    recovered = min(fits, key=lambda config: len(config.obstacles))
    note = (
        f"stored map is not the one played: {reason}; goal {recovered.goal} and obstacles {recovered.obstacles} "
        "recovered from the rewards"
    )
    if any(set(config.obstacles) - set(recovered.obstacles) for config in fits):
        note += "; there may have been further obstacles far from the path"
    return MapFinding(recovered, ("map_mismatch", "map_recovered"), (note,))


def check_by_path(
    stored: MapConfig, states: Array, final_state: Array, last_action: Array, physics: Physics
) -> MapFinding:
    """Compares the stored map with the path alone: start, contacts along the path, and contact at its end.

    Args:
        states: `(T, 7)`.
        final_state: `(7,)`.
    """
    first = np.array((*states[0, :2], np.arctan2(states[0, 3], states[0, 2])))
    restarted = replace(stored, start=start_pose(first))
    reason = start_differs(stored, first)
    if not reason and (rows_inside := _rows_inside(stored, states)) > _TOUCHING_ROWS:
        reason = f"the path runs through its goal or obstacles in {rows_inside} rows"
    ending = outcome(stored, physics, final_state, last_action)
    reached = _other_goals(restarted, physics, final_state, last_action)
    if not reason and ending is None and reached:
        reason = "the path ends without contact with it"
    if not reason:
        return MapFinding(stored)
    note = f"stored map is not the one played: {reason}"
    if ending == "goal" or len(reached) != 1:
        return MapFinding(restarted, ("map_mismatch",), (f"{note}; its goal and obstacles may be wrong",))
    note += f"; goal {reached[0].goal} recovered from the table's final pose, its obstacles may be wrong"
    return MapFinding(reached[0], ("map_mismatch", "goal_recovered"), (note,))


def _other_goals(config: MapConfig, physics: Physics, final_state: Array, last_action: Array) -> list[MapConfig]:
    """The map with each other known goal that the table touches at its final pose."""
    goals = {original.goal for original in ORIGINAL_MAPS} - {config.goal}
    candidates = [replace(config, goal=goal) for goal in sorted(goals)]
    return [candidate for candidate in candidates if outcome(candidate, physics, final_state, last_action) == "goal"]


def _reward_error(config: MapConfig, positions: Array, rewards: Array) -> float:
    expected = np.array([reward(x, y, config) for x, y in positions.tolist()])
    return float(np.abs(expected - rewards).max())


def _candidates(moved: MapConfig) -> list[MapConfig]:
    known_layouts = {(config.goal, tuple(sorted(config.obstacles))): None for config in ORIGINAL_MAPS}
    return [moved, *(replace(moved, goal=goal, obstacles=obstacles) for goal, obstacles in known_layouts)]


def _rows_inside(config: MapConfig, states: Array) -> int:
    world = TableWorld(config)
    contacts = (world.contact((s[0], s[1], np.arctan2(s[3], s[2]))) for s in states)
    return sum(contact.goal or contact.obstacle for contact in contacts)
