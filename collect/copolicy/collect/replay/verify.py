"""Whether the recorded actions, simulated again from the recorded start, lead through the recorded states."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import Outcome, get_task
from copolicy.tasks.table.features import theta_of

from ..agents import RecordedAgent
from ..rollout import Rollout, Trace
from .track import Track

LIMIT_PX = 0.01
"""Largest drift of the position that counts as the same motion, px; the sums of a double stay below 1e-9."""

LIMIT_RAD = 1e-4
"""The same for the orientation, rad."""

ANGULAR_LIMITS = {"pi/2": math.pi / 2, "pi/8": math.pi / 8}
"""Bounds on the angular acceleration that recordings are made with, rad/s^2."""

_PHYSICAL = ("goal", "collision_obstacle", "collision_wall")


def verify(
    track: Track,
    angular_limit: str | None = None,
    limit_px: float = LIMIT_PX,
    limit_rad: float = LIMIT_RAD,
) -> dict[str, Any]:
    """Simulates the actions again and compares.

    Args:
        track: the recording.
        angular_limit: one of `ANGULAR_LIMITS`; by default the bound that the recording states.
        limit_px: largest drift of the position that passes, px.
        limit_rad: largest drift of the orientation that passes, rad.

    Returns:
        Largest and last drift in px and rad, the first step beyond the limit, whether the world ends the episode
        where and as the recording says, `reproduced`, and what of the file carries no check sum; JSON-able, with exit
        status 1 where it is not reproduced.

    Raises:
        InvalidValueError: an unknown bound, or a limit that is no positive number.
    """
    if angular_limit is not None and angular_limit not in ANGULAR_LIMITS:
        raise InvalidValueError("angular limit", f"one of {sorted(ANGULAR_LIMITS)}", angular_limit)
    for name, limit in (("limit in px", limit_px), ("limit in rad", limit_rad)):
        if not 0 < limit < math.inf:
            raise InvalidValueError(name, "a positive number", limit)
    recorded_limit = track.episode.physics.angular_acceleration_limit
    limit_used = ANGULAR_LIMITS[angular_limit] if angular_limit else recorded_limit
    px, rad, outcome, ended = _simulate(track, limit_used)
    beyond = np.flatnonzero((px > limit_px) | (rad > limit_rad))
    recorded = track.episode.meta.termination_reason
    physical = recorded in _PHYSICAL
    # An episode that somebody broke off ends in the middle, and the world must agree with that too.
    same_end = (outcome.reason == recorded and ended == track.steps) if physical else not outcome.done
    reproduced = not len(beyond) and same_end
    return {
        "file": track.path.name,
        "steps": track.steps,
        "angular_limit": limit_used,
        "max_drift_px": float(px.max()),
        "max_drift_rad": float(rad.max()),
        "last_drift_px": float(px[-1]),
        "last_drift_rad": float(rad[-1]),
        "limit_px": limit_px,
        "limit_rad": limit_rad,
        "first_step_beyond": int(beyond[0]) if len(beyond) else None,
        "recorded_end": f"{recorded} after {track.steps} steps",
        "simulated_end": f"{outcome.reason} after {ended} steps" if outcome.done else "none",
        "reproduced": bool(reproduced),
        "not_verified": list(track.episode.notes),
        "exit_status": int(not reproduced),
    }


def _simulate(track: Track, angular_limit: float) -> tuple[np.ndarray, np.ndarray, Outcome, int]:
    """Drift `(T + 1,)` in px and in rad, and the first contact that ends an episode with its step."""
    # The step limit is a setting of the session, not of the motion.
    episode = track.episode
    physics = replace(episode.physics, angular_acceleration_limit=angular_limit, step_limit=track.steps + 1)
    states = np.vstack((episode.states, episode.final_state))
    task = get_task()
    world = task.make_world(episode.map_config, physics)
    world.restore((*track.poses[0], *states[0, 4:].tolist()))
    agents = (RecordedAgent([episode.actions]), RecordedAgent([episode.actions]))
    # To the last recorded action, also where the world ends the episode before.
    rollout = Rollout(task, [episode.map_config], agents, worlds=[world], beyond_end=True)
    trace = Trace(rollout)
    rollout.run(track.steps)
    simulated, (first,) = trace.states(0), rollout.outcomes
    px = np.linalg.norm(simulated[:, :2] - states[:, :2], axis=1)
    turn = simulated[:, 2] - theta_of(states)
    ended = rollout.ends[0] if first.done else track.steps
    return px, np.abs((turn + math.pi) % (2 * math.pi) - math.pi), first, ended
