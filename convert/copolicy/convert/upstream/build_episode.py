"""Builds an Episode from any of the original program's formats: options, outcome and episode columns.

Quality flags of the importers:
    map_mismatch       the file's map is not the one that was played (its script picks map files by substring)
    map_recovered      goal and obstacles were taken from the rows, or recovered from the stored rewards
    goal_recovered     only the goal was recovered, from the table's final pose; the obstacles are the file's
    excluded: map_mismatch
                       the obstacles, perhaps also the goal, may be wrong; same flag as `copolicy-dataset exclude`
    dynamics_mismatch  the rows do not follow from the actions under the dynamics
    outcome_differs    the file's success flag differs from the contact test
"""

import hashlib
import math
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.settings_text import settings_text
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.features import states_7, theta_of
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import identify
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.routes import route_class
from copolicy.tasks.table.world import TableWorld

from ..lerobot.prepare import replay_drift

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
"""Bounds on the angular acceleration that versions of the program used, rad/s^2."""

_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_URL, "https://github.com/eleyng/table-carrying-ai")
_ROUNDING = 1e-9  # px, rad: residuals closer than this are equal
_MISSING_STEPS = 2  # a 10 Hz row covers three steps, so up to two steps may follow the last row


@dataclass(frozen=True)
class UpstreamOptions:
    """Settings that the files do not state.

    Attributes:
        angular_limit: a key of `ANGULAR_LIMITS`, or `auto`: for each episode the limit that fits its rows.
        obstacle_size: side of the obstacles, px.
    """

    angular_limit: str = "auto"
    obstacle_size: int = 50


@dataclass(frozen=True)
class Trajectory:
    """States before each action, as in `Episode`, and their deviation from the dynamics.

    Attributes:
        states: `(T, 6)` x, y, theta, vx, vy, omega.
        actions: `(T, 4)` within [-1, 1].
        final_state: `(6,)`.
        residual: largest deviation of a step from the dynamics, px or rad.
        physics_known: the angular limit was given, or no other limit fits the rows equally well.
    """

    states: Array
    actions: Array
    final_state: Array
    physics: Physics
    residual: float
    physics_known: bool = True


def best_fit(fit: Callable[[Physics], Trajectory], angular_limit: str) -> Trajectory:
    """Fits the trajectory with the named angular limit, or with the one that gives the smallest residual."""
    names = ANGULAR_LIMITS if angular_limit == "auto" else (angular_limit,)
    fits = [fit(Physics(angular_acceleration_limit=ANGULAR_LIMITS[name])) for name in names]
    best = min(fits, key=lambda trajectory: trajectory.residual)
    # Rows that turn too slowly to reach a limit fit both.
    residuals = [trajectory.residual for trajectory in fits if trajectory is not best]
    return replace(best, physics_known=all(residual > 2 * best.residual + _ROUNDING for residual in residuals))


def start_pose(state: Array) -> tuple[float, float, float]:
    """Start pose of a map from a first state `(6,)`, rounded to remove the noise of single precision."""
    x, y, theta = (float(value) for value in state[:3])
    return round(x, 3), round(y, 3), round(theta % (2 * math.pi), 5)


def outcome(config: MapConfig, physics: Physics, final_state: Array, last_action: Array) -> str | None:
    """Termination reason of an episode: contact at the last pose or, with the last action repeated, in the next two
    steps. None without contact.

    The same for every format: a 10 Hz row may be two steps before the end, and where the contact test and the
    original's pixel comparison disagree, the table is within a pixel of contact.
    """
    world = TableWorld(config, physics)
    x, y, _, _, vx, vy, omega = final_state.tolist()
    world.reset((x, y, float(theta_of(final_state))), (vx, vy, omega))
    for _ in range(_MISSING_STEPS + 1):
        contact = world.contact(world.pose)
        if contact.goal:
            return "goal"
        if contact.obstacle:
            return "collision_obstacle"
        if contact.wall:
            return "collision_wall"
        world.step(last_action)
    return None


def build_episode(
    trajectory: Trajectory,
    config: MapConfig,
    content: bytes,
    fps: int,
    origin: str,
    flags: tuple[str, ...],
    notes: tuple[str, ...],
    recorded_success: bool | None = None,
) -> Episode:
    """Builds the Episode with the columns that such a file can fill.

    An episode with a wrong map that could not be recovered is excluded: it shows two people avoiding obstacles that
    are not where the map has them, which a policy would learn.

    Args:
        content: bytes that identify the episode; its id and `source_sha256` are computed from them.
        origin: file and position of the episode, stated in the first note.
        recorded_success: the file's success flag, if it has one.
    """
    states, final_state = states_7(trajectory.states), states_7(trajectory.final_state)
    physics = trajectory.physics
    reason = outcome(config, physics, final_state, trajectory.actions[-1])
    success = reason == "goal"
    if recorded_success is not None and recorded_success != success:
        flags += ("outcome_differs",)
        notes += (f"the file states success={recorded_success}, the contact test gives {success}",)
    steps = len(states) if fps == RECORD_HZ else (len(states) - 1) * RECORD_HZ // fps + 1
    if reason is None:
        reason = "timeout" if steps >= physics.step_limit else "unknown"
    excluded = _wrong_map(flags)
    if excluded:
        flags += (f"{EXCLUDED_PREFIX}map_mismatch",)
    digest = hashlib.sha256(content).hexdigest()
    map_id, map_set = identify(config)
    path = np.vstack((states[:, :2], final_state[:2]))
    meta = EpisodeMeta(
        episode_uuid=str(uuid.uuid5(_NAMESPACE, digest)),
        map_id=map_id,
        map_set=map_set,
        source="upstream",
        success=success,
        termination_reason=reason,
        duration_s=steps / RECORD_HZ,
        route_class=route_class(path, config),
        quality_flags=",".join(flags),
        discarded=excluded,
        source_sha256=digest,
        physics=settings_text(physics) if trajectory.physics_known and "dynamics_mismatch" not in flags else "",
        obstacle_size=config.obstacle_size,
    )
    limit = next(name for name, value in ANGULAR_LIMITS.items() if value == physics.angular_acceleration_limit)
    caveat = "" if trajectory.physics_known else ", which the rows do not determine"
    notes = (f"from {origin}, angular limit {limit}{caveat}", *notes)
    episode = Episode(states, trajectory.actions, final_state, meta, config, fps, physics, notes)
    return replace(episode, meta=replace(meta, replay_drift_px=replay_drift(episode)))


def _wrong_map(flags: tuple[str, ...]) -> bool:
    return "map_mismatch" in flags and "map_recovered" not in flags
