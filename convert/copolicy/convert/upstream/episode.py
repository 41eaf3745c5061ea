"""What the importers of the original program's files share: options, outcome, and the finished Episode.

Quality flags that they set:
    map_mismatch       the file's map is not the one that was played (its script picks map files by substring)
    map_recovered      goal and obstacles are those of the rows instead, or were told from the stored rewards
    goal_recovered     only the goal could be told, from where the table ended; the obstacles are the file's
    excluded: map_mismatch
                       the obstacles, or the goal too, may be wrong; as after `copolicy-dataset exclude`
    dynamics_mismatch  the rows do not follow from the actions under the dynamics
    outcome_differs    the file's own success flag is not the one that the contact test gives
"""

import hashlib
import math
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from copolicy.dataset.episode import Episode, EpisodeMeta
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.physics_text import physics_text
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
_SAME = 1e-9  # px, rad: residuals that differ by rounding alone
_MISSING_STEPS = 2  # a 10 Hz row stands for three steps, so that up to two may follow the last row


@dataclass(frozen=True)
class UpstreamOptions:
    """What the files do not say.

    Attributes:
        angular_limit: a key of `ANGULAR_LIMITS`, or `auto`: for each episode the one that its rows follow.
        obstacle_size: side of the obstacles, px.
    """

    angular_limit: str = "auto"
    obstacle_size: int = 50


@dataclass(frozen=True)
class Trajectory:
    """States before each action, as `Episode` has them, and how far they are from following the dynamics.

    Attributes:
        states: `(T, 6)` x, y, theta, vx, vy, omega.
        actions: `(T, 4)` within [-1, 1].
        final_state: `(6,)`.
        residual: largest disagreement of a step with the dynamics, px or rad.
        told: the physics was stated, or no other explains the rows as well.
    """

    states: np.ndarray
    actions: np.ndarray
    final_state: np.ndarray
    physics: Physics
    residual: float
    told: bool = True


def best_fit(fit: Callable[[Physics], Trajectory], angular_limit: str) -> Trajectory:
    """The trajectory under the named angular limit, or under the one that leaves the smallest residual."""
    names = ANGULAR_LIMITS if angular_limit == "auto" else (angular_limit,)
    fits = [fit(Physics(angular_acceleration_limit=ANGULAR_LIMITS[name])) for name in names]
    best = min(fits, key=lambda trajectory: trajectory.residual)
    # Rows that turn so little that no bound is reached follow from either.
    others = [trajectory.residual for trajectory in fits if trajectory is not best]
    return replace(best, told=all(residual > 2 * best.residual + _SAME for residual in others))


def start_pose(state: np.ndarray) -> tuple[float, float, float]:
    """Start of a map from a first state `(6,)`, without the noise of single precision."""
    x, y, theta = (float(value) for value in state[:3])
    return round(x, 3), round(y, 3), round(theta % (2 * math.pi), 5)


def outcome(config: MapConfig, physics: Physics, final_state: np.ndarray, last_action: np.ndarray) -> str | None:
    """What ended an episode: what the table touches at its last stored pose or, holding the last action, in the
    next two steps.

    One rule for every format: a 10 Hz row may be two steps before the end, and where the contact test and the
    original's comparison of pixels disagree the table is within a pixel of touching. None where nothing is touched.
    """
    world = TableWorld(config, physics)
    x, y, _, _, vx, vy, omega = final_state.tolist()
    world.reset((x, y, float(theta_of(final_state))), (vx, vy, omega))
    for _ in range(_MISSING_STEPS + 1):
        touched = world.contact(world.pose)
        if touched.goal:
            return "goal"
        if touched.obstacle:
            return "collision_obstacle"
        if touched.wall:
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
    """An Episode with the columns that such a file can fill.

    One whose map is not the one that was played and could not be recovered is excluded: it shows two people steering
    around obstacles that were elsewhere, and a policy would learn to.

    Args:
        content: bytes that identify the episode; its id and `source_sha256` follow from them.
        origin: where in the files the episode is; the first note says so.
        recorded_success: the file's own flag, if it has one.
    """
    states, final_state = states_7(trajectory.states), states_7(trajectory.final_state)
    physics = trajectory.physics
    reason = outcome(config, physics, final_state, trajectory.actions[-1])
    success = reason == "goal"
    if recorded_success is not None and recorded_success != success:
        flags += ("outcome_differs",)
        notes += (f"the file says success={recorded_success}, the contact test {success}",)
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
        physics=physics_text(physics) if trajectory.told and "dynamics_mismatch" not in flags else "",
        obstacle_size=config.obstacle_size,
    )
    limit = next(name for name, value in ANGULAR_LIMITS.items() if value == physics.angular_acceleration_limit)
    doubt = "" if trajectory.told else ", which the rows do not tell"
    notes = (f"from {origin}, angular limit {limit}{doubt}", *notes)
    episode = Episode(states, trajectory.actions, final_state, meta, config, fps, physics, notes)
    return replace(episode, meta=replace(meta, replay_drift_px=replay_drift(episode)))


def _wrong_map(flags: tuple[str, ...]) -> bool:
    return "map_mismatch" in flags and "map_recovered" not in flags
