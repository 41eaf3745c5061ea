"""What the players' hands did: range, idle and saturated input, numbers that are none."""

from collections.abc import Iterator

import numpy as np

from ..features import ACTION, STATE
from ..shared_device import any_force, may_be_one_device, same_action
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding

_WHO = ("source", "controller_0", "controller_1")


def _finite(table: EpisodeData) -> Iterator[Finding]:
    for name, values in table.frames.items():
        if values.dtype.kind != "f":
            continue
        rows = values.reshape(table.frame_count, -1)
        wrong = table.count(np.asarray(~np.isfinite(rows).all(axis=1)))
        yield from table.found("finite", wrong > 0, wrong, 0, f"frames whose {name} is not finite")


def _action_range(table: EpisodeData) -> Iterator[Finding]:
    actions = table.frames[ACTION]
    low, high = table.task.spec.joint_action.bounds.astype(actions.dtype)
    # In full forces; exact where the bounds are -1 and 1.
    scaled = (actions - (low + high) / 2) / ((high - low) / 2)
    largest, bound = table.largest(np.abs(scaled).max(axis=1)).astype(float), table.limit("action_range")
    message = "an action is larger than a player's full force"
    yield from table.found("action_range", largest > bound, largest, bound, message)


def _state_range(table: EpisodeData) -> Iterator[Finding]:
    vector = table.task.spec.state
    states, (low, high) = table.frames[STATE].astype(float), vector.bounds
    tolerances = table.limit("state_range") * (high - low)
    outside = np.maximum(low - states, states - high)
    for name, unit, tolerance, values in zip(vector.names, vector.units, tolerances.tolist(), outside.T, strict=True):
        worst = table.largest(values)
        message = f"{name} is this far outside its bounds, in {unit}"
        yield from table.found("state_range", worst > tolerance, worst, tolerance, message)


def _idle(table: EpisodeData) -> Iterator[Finding]:
    human = table.framed_column("source") == "human"
    usual, never, run = (table.limit(name) for name in ("idle.warning", "idle.error", "idle_run"))
    for player, seat in enumerate(table.task.spec.players):
        who = f"player {player} ({seat})"
        idle = np.linalg.norm(table.player_force(player), axis=1) < table.limit("idle_force")
        share = table.share(idle)
        absent = (share >= never) & human
        yield from table.found("idle", absent, share, never, f"{who} gave no force in the whole episode")
        message = f"share of frames in which {who} gave no force"
        yield from table.found("idle", (share > usual) & ~absent, share, usual, message, "warning")
        seconds = table.longest_run(idle) / table.fps
        message = f"{who} gave no force for this many s at a stretch"
        yield from table.found("idle_run", (seconds > run) & ~(share > usual), seconds, run, message, "info")


def _identical(table: EpisodeData) -> Iterator[Finding]:
    """A frame in which nobody gives a force says nothing: two idle players are no copy of each other."""
    actions = table.task.spec.full_forces(table.frames[ACTION])
    pushed = table.share(any_force(actions))
    share = np.divide(table.share(same_action(actions)), pushed, out=np.zeros_like(pushed), where=pushed > 0)
    bound = table.limit("identical")
    found = share >= bound
    # A scripted pair may be made to act as one, and two kinds of device, or halves of a keyboard, are two for sure.
    people = table.framed_column("source") == "human"
    columns = zip(*(table.framed_column(name).tolist() for name in _WHO), strict=True)
    devices = np.array([may_be_one_device(*who) for who in columns], bool)
    message = "both players gave the same actions"
    yield from table.found("identical", found & devices, share, bound, f"{message}: one device moved both")
    yield from table.found("identical", found & people & ~devices, share, bound, message, "warning")
    yield from table.found("identical", found & ~people, share, bound, message, "info")


def _saturated(table: EpisodeData) -> Iterator[Finding]:
    bound = table.limit("saturated")
    for player, seat in enumerate(table.task.spec.players):
        share = table.share(np.abs(table.player_force(player)).max(axis=1) > table.limit("saturated_force"))
        # A key knows nothing but its stop, and a player at keys is no mistake.
        keys = np.char.find(np.char.lower(table.framed_column(f"controller_{player}")), "keyboard") >= 0
        message = f"share of frames in which player {player} ({seat}) was at the stop"
        yield from table.found("saturated", (share > bound) & ~keys, share, bound, message, "warning")
        yield from table.found("saturated", (share > bound) & keys, share, bound, message, "info")


RULES = (
    Rule("finite", "all numbers of the frames are finite", _finite, (STATE, ACTION)),
    Rule("action_range", "actions within a player's full force", _action_range, (ACTION,)),
    Rule("state_range", "states within the bounds of the task", _state_range, (STATE,)),
    Rule("idle", "both players take part", _idle, (ACTION,), ("source",)),
    Rule("identical", "the players do not act as one", _identical, (ACTION,), _WHO),
    Rule("saturated", "sticks are not always at their stop", _saturated, (ACTION,), ("controller_0", "controller_1")),
)
