"""Which map was really played: the original's scripts may have stored another episode's.

Its `process_data*.py` choose map files by substring, so that ep_1 may get the map of ep_10 or ep_11.
"""

from dataclasses import dataclass, replace

import numpy as np

from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import ORIGINAL_MAPS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.reward import reward
from copolicy.tasks.table.world import TableWorld

from .episode import outcome, start_pose

_START_TOLERANCE = 1.0  # px
_REWARD_TOLERANCE = 2e-6  # rewards were computed from, and stored as, single precision
_TOUCHING_ROWS = 3  # rows that may graze a solid where the contact test and the original disagree


@dataclass(frozen=True)
class MapFinding:
    """The map to use, with what to flag and say about it."""

    config: MapConfig
    flags: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def rounded(config: MapConfig) -> MapConfig:
    """A map without the noise of single precision: positions to 0.001 px, the orientation to 0.00001 rad."""
    (x, y, theta), goal = config.start, config.goal
    obstacles = tuple((round(cx, 3), round(cy, 3)) for cx, cy in config.obstacles)
    start = (round(x, 3), round(y, 3), round(theta, 5))
    return replace(config, start=start, goal=(round(goal[0], 3), round(goal[1], 3)), obstacles=obstacles)


def start_differs(config: MapConfig, first_state: np.ndarray) -> str:
    """Says how far the map's start is from the first state `(6,)` where that is too far, else empty."""
    distance = float(np.hypot(*(np.asarray(config.start[:2]) - first_state[:2])))
    return f"its start is {distance:.0f} px from the path's" if distance > _START_TOLERANCE else ""


def check_by_rewards(stored: MapConfig, first_state: np.ndarray, after: np.ndarray, rewards: np.ndarray) -> MapFinding:
    """Compares the stored map with the rewards of the positions `(T, 2)` after each action, and finds the true one.

    The rewards were computed while playing, on the map that was played. Among the goals and obstacles of the known
    maps the fewest that give these rewards are taken; obstacles that the path stayed 270 px away from leave no trace.
    """
    reason = start_differs(stored, first_state)
    error = _reward_error(stored, after, rewards)
    if error > _REWARD_TOLERANCE:
        reason = reason or f"its rewards are up to {error:.2g} from the stored ones"
    if not reason:
        return MapFinding(stored)
    moved = replace(stored, start=start_pose(first_state))
    fits = [config for config in _candidates(moved) if _reward_error(config, after, rewards) <= _REWARD_TOLERANCE]
    if not fits:
        note = f"stored map is not the one played: {reason}; no known map gives the rewards, goal and obstacles kept"
        return MapFinding(moved, ("map_mismatch",), (note,))
    found = min(fits, key=lambda config: len(config.obstacles))
    note = (
        f"stored map is not the one played: {reason}; goal {found.goal} and obstacles {found.obstacles} "
        "recovered from the rewards"
    )
    if any(set(config.obstacles) - set(found.obstacles) for config in fits):
        note += "; others far from the path may have stood there too"
    return MapFinding(found, ("map_mismatch", "map_recovered"), (note,))


def check_by_path(
    stored: MapConfig, states: np.ndarray, final_state: np.ndarray, last_action: np.ndarray, physics: Physics
) -> MapFinding:
    """Compares the stored map with the path alone: its start, what it passed through, and what it ended at.

    Args:
        states: `(T, 7)`.
        final_state: `(7,)`.
    """
    first = np.array((*states[0, :2], np.arctan2(states[0, 3], states[0, 2])))
    moved = replace(stored, start=start_pose(first))
    reason = start_differs(stored, first)
    if not reason and (through := _rows_inside(stored, states)) > _TOUCHING_ROWS:
        reason = f"the path runs through its goal or obstacles in {through} rows"
    ends_here = outcome(stored, physics, final_state, last_action)
    reached = _other_goals(moved, physics, final_state, last_action)
    if not reason and ends_here is None and reached:
        reason = "the path ends where nothing of it is touched"
    if not reason:
        return MapFinding(stored)
    note = f"stored map is not the one played: {reason}"
    if ends_here == "goal" or len(reached) != 1:
        return MapFinding(moved, ("map_mismatch",), (f"{note}; its goal and obstacles may be wrong",))
    note += f"; goal {reached[0].goal} recovered from where the table ended, its obstacles may be wrong"
    return MapFinding(reached[0], ("map_mismatch", "goal_recovered"), (note,))


def _other_goals(
    config: MapConfig, physics: Physics, final_state: np.ndarray, last_action: np.ndarray
) -> list[MapConfig]:
    """The map with each other known goal that the table ended at."""
    goals = {known.goal for known in ORIGINAL_MAPS} - {config.goal}
    others = [replace(config, goal=goal) for goal in sorted(goals)]
    return [other for other in others if outcome(other, physics, final_state, last_action) == "goal"]


def _reward_error(config: MapConfig, after: np.ndarray, rewards: np.ndarray) -> float:
    expected = np.array([reward(x, y, config) for x, y in after.tolist()])
    return float(np.abs(expected - rewards).max())


def _candidates(moved: MapConfig) -> list[MapConfig]:
    known = {(config.goal, tuple(sorted(config.obstacles))): None for config in ORIGINAL_MAPS}
    return [moved, *(replace(moved, goal=goal, obstacles=obstacles) for goal, obstacles in known)]


def _rows_inside(config: MapConfig, states: np.ndarray) -> int:
    world = TableWorld(config)
    touches = (world.contact((s[0], s[1], np.arctan2(s[3], s[2]))) for s in states)
    return sum(touched.goal or touched.obstacle for touched in touches)
