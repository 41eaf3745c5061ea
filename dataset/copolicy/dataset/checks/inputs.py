"""Rules on actions and states: finite, within range, idle, identical and saturated input."""

from collections.abc import Iterator

import numpy as np

from ..features import ACTION, STATE
from ..shared_device import any_force, may_be_one_device, same_action
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding

_DEVICE_COLUMNS = ("source", "controller_0", "controller_1")


def _finite(data: EpisodeData) -> Iterator[Finding]:
    for name, values in data.frames.items():
        if values.dtype.kind != "f":
            continue
        rows = values.reshape(data.frame_count, -1)
        wrong = data.count(np.asarray(~np.isfinite(rows).all(axis=1)))
        yield from data.findings("finite", wrong > 0, wrong, 0, f"frames whose {name} is not finite")


def _action_range(data: EpisodeData) -> Iterator[Finding]:
    actions = data.frames[ACTION]
    low, high = data.task.spec.joint_action.bounds.astype(actions.dtype)
    # In full forces; exact for bounds of -1 and 1.
    scaled = (actions - (low + high) / 2) / ((high - low) / 2)
    largest, bound = data.maximum(np.abs(scaled).max(axis=1)).astype(float), data.limit("action_range")
    message = "an action is larger than a player's full force"
    yield from data.findings("action_range", largest > bound, largest, bound, message)


def _state_range(data: EpisodeData) -> Iterator[Finding]:
    vector = data.task.spec.state
    states, (low, high) = data.frames[STATE].astype(float), vector.bounds
    tolerances = data.limit("state_range") * (high - low)
    outside = np.maximum(low - states, states - high)
    for name, unit, tolerance, values in zip(vector.names, vector.units, tolerances.tolist(), outside.T, strict=True):
        worst = data.maximum(values)
        message = f"{name} is this far outside its bounds, in {unit}"
        yield from data.findings("state_range", worst > tolerance, worst, tolerance, message)


def _idle(data: EpisodeData) -> Iterator[Finding]:
    human = data.framed_column("source") == "human"
    warning, error, run_limit = (data.limit(name) for name in ("idle.warning", "idle.error", "idle_run"))
    for player, seat in enumerate(data.task.spec.players):
        subject = f"player {player} ({seat})"
        idle = np.linalg.norm(data.player_force(player), axis=1) < data.limit("idle_force")
        idle_part = data.proportion(idle)
        absent = (idle_part >= error) & human
        yield from data.findings("idle", absent, idle_part, error, f"{subject} gave no force in the whole episode")
        often, message = idle_part > warning, f"proportion of frames in which {subject} gave no force"
        yield from data.findings("idle", often & ~absent, idle_part, warning, message, "warning")
        seconds = data.longest_run(idle) / data.fps
        message = f"{subject} gave no force for this many consecutive s"
        yield from data.findings("idle_run", (seconds > run_limit) & ~often, seconds, run_limit, message, "info")


def _identical(data: EpisodeData) -> Iterator[Finding]:
    """Compares only frames with a force: two idle players are not identical."""
    actions = data.task.spec.full_forces(data.frames[ACTION])
    active = data.proportion(any_force(actions))
    proportion = np.divide(data.proportion(same_action(actions)), active, out=np.zeros_like(active), where=active > 0)
    limit = data.limit("identical")
    identical = proportion >= limit
    # Scripted pairs may act identically by design; different kinds of device, or keyboard halves, are two devices.
    people = data.framed_column("source") == "human"
    columns = zip(*(data.framed_column(name).tolist() for name in _DEVICE_COLUMNS), strict=True)
    devices = np.array([may_be_one_device(*values) for values in columns], bool)
    message = "both players gave the same actions"
    cause = f"{message}: one device controlled both"
    yield from data.findings("identical", identical & devices, proportion, limit, cause)
    yield from data.findings("identical", identical & people & ~devices, proportion, limit, message, "warning")
    yield from data.findings("identical", identical & ~people, proportion, limit, message, "info")


def _saturated(data: EpisodeData) -> Iterator[Finding]:
    bound = data.limit("saturated")
    for player, seat in enumerate(data.task.spec.players):
        proportion = data.proportion(np.abs(data.player_force(player)).max(axis=1) > data.limit("saturated_force"))
        # A key always gives the full force, which is no error.
        keyboard = np.char.find(np.char.lower(data.framed_column(f"controller_{player}")), "keyboard") >= 0
        message = f"proportion of frames in which player {player} ({seat}) was at the stop"
        yield from data.findings("saturated", (proportion > bound) & ~keyboard, proportion, bound, message, "warning")
        yield from data.findings("saturated", (proportion > bound) & keyboard, proportion, bound, message, "info")


RULES = (
    Rule("finite", "all numbers of the frames are finite", _finite, (STATE, ACTION)),
    Rule("action_range", "actions within a player's full force", _action_range, (ACTION,)),
    Rule("state_range", "states within the bounds of the task", _state_range, (STATE,)),
    Rule("idle", "both players take part", _idle, (ACTION,), ("source",)),
    Rule("identical", "the players do not act as one", _identical, (ACTION,), _DEVICE_COLUMNS),
    Rule("saturated", "sticks are not always at their stop", _saturated, (ACTION,), ("controller_0", "controller_1")),
)
