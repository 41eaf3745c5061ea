"""Verification of a recording: simulates its actions from its first state and compares the states."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import Outcome
from copolicy.dataset.task_spec import TIMEOUT

from ..agents import RecordedAgent
from ..angular_limit import angular_limit_of, with_angular_limit
from ..rollout import Rollout, Trace
from .track import Track


def verify(
    track: Track, angular_limit: str | None = None, limit_px: float | None = None, limit_rad: float | None = None
) -> dict[str, Any]:
    """Simulates the recorded actions again and measures the drift of the states (`PairTask.drift`).

    Args:
        track: of the recording.
        angular_limit: one of `ANGULAR_LIMITS`; by default the bound in the recording.
        limit_px: largest position drift that passes, px; by default the task's.
        limit_rad: largest orientation drift that passes, rad; by default the task's.

    Returns:
        Largest and last drift, the first step beyond the limits, recorded and simulated end, whether states and end
        are `reproduced`, and which parts of the file have no checksum; JSON-able, with exit status 1 if not
        reproduced.

    Raises:
        InvalidValueError: the task has no such bound or limit, or a limit is not a positive number.
    """
    task, episode = track.task, track.episode
    limits = dict(task.drift_limits)
    for name, limit in (("px", limit_px), ("rad", limit_rad)):
        if limit is None:
            continue
        if name not in limits:
            raise InvalidValueError(f"--max-drift-{name}", f"none: drift is measured as {', '.join(limits)}", limit)
        if not 0 < limit < math.inf:
            raise InvalidValueError(f"limit in {name}", "a positive number", limit)
        limits[name] = limit
    settings = episode.settings if angular_limit is None else with_angular_limit(task, episode.settings, angular_limit)
    drift, outcome, ended = _simulate(track, settings)
    violations = np.flatnonzero((drift > list(limits.values())).any(axis=1))
    recorded = episode.meta.termination_reason
    # After a time-out or an interruption, the simulated world must not have ended the episode either.
    physical = recorded in task.spec.reasons and recorded != TIMEOUT
    same_end = (outcome.reason == recorded and ended == track.steps) if physical else not outcome.done
    reproduced = not len(violations) and same_end
    bound = angular_limit_of(settings)
    return {
        "file": track.path.name,
        "steps": track.steps,
        **({"settings": task.settings_summary(settings)} if bound is None else {"angular_limit": bound}),
        **{f"max_drift_{name}": float(value) for name, value in zip(limits, drift.max(axis=0), strict=True)},
        **{f"last_drift_{name}": float(value) for name, value in zip(limits, drift[-1], strict=True)},
        **{f"limit_{name}": limit for name, limit in limits.items()},
        "first_step_beyond": int(violations[0]) if len(violations) else None,
        "recorded_end": f"{recorded} after {track.steps} steps",
        "simulated_end": f"{outcome.reason} after {ended} steps" if outcome.done else "none",
        "reproduced": bool(reproduced),
        "not_verified": list(episode.notes),
        "exit_status": int(not reproduced),
    }


def _simulate(track: Track, settings: Any) -> tuple[Array, Outcome, int]:
    """Returns the drift `(T + 1, n)` of each state, and the first outcome that ends an episode with its step."""
    task, episode = track.task, track.episode
    recorded = task.recorded_of(np.vstack((episode.states, episode.final_state)))
    # The step limit is a setting of the session, not of the motion.
    world = task.make_world(episode.scenario, replace(settings, step_limit=track.steps + 1))
    world.restore(tuple(recorded[0].tolist()))
    agents = (RecordedAgent([episode.actions]), RecordedAgent([episode.actions]))
    # Runs to the last recorded action, even if the world ends the episode earlier.
    rollout = Rollout(task, [episode.scenario], agents, worlds=[world], beyond_end=True)
    trace = Trace(rollout)
    rollout.run(track.steps)
    (first,) = rollout.outcomes
    return task.drift(trace.states(0), recorded), first, rollout.ends[0] if first.done else track.steps
