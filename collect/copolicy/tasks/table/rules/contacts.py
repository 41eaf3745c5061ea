"""Checks of success and termination against the possible contacts; a contradiction usually means a wrong map."""

from collections.abc import Iterator

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.checks.episode_data import EpisodeData
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.task_parts import Rule

from ..features import parse_sizes
from ..map_config import MAX_OBSTACLES, WINDOW
from ..physics import GOAL_SIZE
from ..spec import SPEC
from .contact_bounds import INNER, OUTER, final_poses, separation

_SIZES = (45, 50)  # px, possible sides of obstacles where the data do not say which


def _goal(table: EpisodeData) -> Iterator[Finding]:
    margin = table.limit("contact_margin")
    maps = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    success = table.framed_column("success")
    gap, error = _final_gap(table, maps[:, 3:5], GOAL_SIZE / 2)
    bound = margin + error
    message = "a success, but the table ended this many px from the goal of its map"
    yield from table.findings("goal_contact", success & ~(gap <= bound), gap, bound, message)
    depth = _deepest(table, np.repeat(maps[:, 3:5], table.counts, axis=0), GOAL_SIZE / 2)
    message = "no success, but the table was this many px inside the goal of its map"
    yield from table.findings("goal_contact", ~success & (depth > margin), depth, margin, message)


def _obstacles(table: EpisodeData) -> Iterator[Finding]:
    margin = table.limit("contact_margin")
    maps = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    smallest, largest = _obstacle_sides(table)
    deepest = np.full(len(table.starts), -np.inf)
    nearest = np.full(len(table.starts), np.inf)
    error = 0.0
    for slot in range(MAX_OBSTACLES):
        centres = maps[:, 5 + 2 * slot : 7 + 2 * slot]
        exists = (centres != 0).any(axis=1)
        halves = np.repeat(smallest[:, slot] / 2, table.counts)
        depth = _deepest(table, np.repeat(centres, table.counts, axis=0), halves)
        gap, error = _final_gap(table, centres, largest[:, slot] / 2)
        deepest = np.where(exists, np.maximum(deepest, depth), deepest)
        nearest = np.where(exists, np.minimum(nearest, gap), nearest)
    message = "the table went this many px into an obstacle of its map before the episode ended"
    yield from table.findings("obstacle_contact", deepest > margin, deepest, margin, message)
    collided = table.framed_column("termination_reason") == "collision_obstacle"
    bound = margin + error
    message = "ended by a collision, but this many px from every obstacle of its map"
    yield from table.findings("obstacle_contact", collided & ~(nearest <= bound), nearest, bound, message)


def _obstacle_sides(table: EpisodeData) -> tuple[Array, Array]:
    """Smallest and largest possible side of each obstacle, `(F, 3)` px each."""
    shape = (len(table.starts), MAX_OBSTACLES)
    smallest, largest = (np.full(shape, float(size)) for size in _SIZES)
    if "obstacle_size" in table.columns:
        stored = np.broadcast_to(table.framed_column("obstacle_size").astype(float)[:, None], shape)
        smallest, largest = (np.where(stored > 0, stored, guessed) for guessed in (smallest, largest))
    if "obstacle_sizes" in table.columns:
        texts = table.framed_column("obstacle_sizes")
        for index in np.flatnonzero(texts != ""):
            sizes = parse_sizes(str(texts[index]))[:MAX_OBSTACLES]
            smallest[index, : len(sizes)] = largest[index, : len(sizes)] = sizes
    return smallest, largest


def _wall(table: EpisodeData) -> Iterator[Finding]:
    positions, thetas, error = _final(table)
    cos, sin = np.abs(np.cos(thetas)), np.abs(np.sin(thetas))
    half = np.stack((OUTER[1] * cos + OUTER[2] * sin, OUTER[1] * sin + OUTER[2] * cos), axis=-1)
    room = np.minimum(positions - half, np.array(WINDOW, float) - positions - half).min(axis=(0, 2))
    bound = table.limit("contact_margin") + error
    ended = table.framed_column("termination_reason") == "collision_wall"
    message = "ended at the wall, but this many px from it"
    yield from table.findings("wall_contact", ended & ~(room <= bound), room, bound, message)


def _deepest(table: EpisodeData, centres: Array, half: Array | float) -> Array:
    """`(F,)` largest depth of the inner rectangle in a square over all frames, px."""
    states = table.frames[STATE].astype(float)
    thetas = np.arctan2(states[:, 3], states[:, 2])
    return table.maximum(-separation(states[:, :2], thetas, INNER, centres, half))


def _final(table: EpisodeData) -> tuple[Array, Array, float]:
    if table.final_states is not None:
        final = table.final_states
        return final[None, :, :2], np.arctan2(final[:, 3], final[:, 2])[None], 0.0
    return final_poses(table.frames[STATE][table.ends].astype(float), table.fps, SPEC.record_hz)


def _final_gap(table: EpisodeData, centres: Array, half: Array | float) -> tuple[Array, float]:
    """`(F,)` smallest possible distance of the outer rectangle from a square at the end, px, and its error."""
    positions, thetas, error = _final(table)
    gaps = [separation(*pose, OUTER, centres, half) for pose in zip(positions, thetas, strict=True)]
    return np.minimum.reduce(gaps), error


RULES = (
    Rule("goal_contact", "successful episodes, and only these, end at their map's goal", _goal,
         (STATE, ENVIRONMENT_STATE), ("success",)),
    Rule("obstacle_contact", "the table does not pass through obstacles; collisions are near one", _obstacles,
         (STATE, ENVIRONMENT_STATE), ("termination_reason",)),
    Rule("wall_contact", "episodes that ended at the wall are near it", _wall, (STATE,), ("termination_reason",)),
)  # fmt: skip
