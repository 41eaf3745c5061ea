"""What the players' hands did: range, idle and saturated input, numbers that are none."""

from collections.abc import Iterator

import numpy as np

from ..features import ACTION, STATE
from ..interaction import alike, may_be_one_device, pushing
from ..task_spec import PLAYERS
from .episode_table import EpisodeTable
from .finding import Finding
from .limits import limit
from .rule import Rule, each

_WHO = ("source", "controller_0", "controller_1")


def _finite(table: EpisodeTable) -> Iterator[Finding]:
    for name, values in table.frames.items():
        if values.dtype.kind != "f":
            continue
        rows = values.reshape(table.frame_count, -1)
        wrong = np.add.reduceat((~np.isfinite(rows).all(axis=1)).astype(int), table.starts)
        message = f"frames whose {name} is not finite"
        yield from each(table, wrong > 0, "finite", wrong, 0, "error", message, table.framed)


def _action_range(table: EpisodeTable) -> Iterator[Finding]:
    largest = np.maximum.reduceat(np.abs(table.frames[ACTION]).max(axis=1), table.starts).astype(float)
    bound = limit("action_range")
    message = "an action is larger than a player's full force"
    yield from each(table, largest > bound, "action_range", largest, bound, "error", message, table.framed)


def _state_range(table: EpisodeTable) -> Iterator[Finding]:
    states = table.frames[STATE].astype(float)
    low, high = table.task.spec.state.bounds
    outside = np.maximum(low - states, states - high)[:, :2].max(axis=1)
    worst = np.maximum.reduceat(outside, table.starts)
    message = "the table's centre is this many px outside the window"
    yield from each(table, worst > 0, "state_range", worst, 0.0, "error", message, table.framed)
    off = np.maximum.reduceat(np.abs(states[:, 2] ** 2 + states[:, 3] ** 2 - 1), table.starts)
    bound = limit("unit_circle")
    message = "cos_theta and sin_theta are not of one angle"
    yield from each(table, off > bound, "state_range", off, bound, "error", message, table.framed)


def _idle(table: EpisodeTable) -> Iterator[Finding]:
    human = table.of_framed("source") == "human"
    usual, never, run = limit("idle.warning"), limit("idle.error"), limit("idle_run")
    for player, name in enumerate(PLAYERS):
        idle = np.linalg.norm(_action(table, player), axis=1) < limit("idle_force")
        share = table.share(idle)
        absent = (share >= never) & human
        message = f"player {player} ({name}) gave no force in the whole episode"
        yield from each(table, absent, "idle", share, never, "error", message, table.framed)
        message = f"share of frames in which player {player} ({name}) gave no force"
        yield from each(table, (share > usual) & ~absent, "idle", share, usual, "warning", message, table.framed)
        seconds = table.longest_run(idle) / table.fps
        message = f"player {player} ({name}) gave no force for this many s at a stretch"
        yield from each(
            table, (seconds > run) & ~(share > usual), "idle_run", seconds, run, "info", message, table.framed
        )


def _identical(table: EpisodeTable) -> Iterator[Finding]:
    """A frame in which nobody gives a force says nothing: two idle players are no copy of each other."""
    pushed = table.share(pushing(table.frames[ACTION]))
    share = np.divide(table.share(alike(table.frames[ACTION])), pushed, out=np.zeros_like(pushed), where=pushed > 0)
    bound = limit("identical")
    found = share >= bound
    # A scripted pair may be made to act as one, and two kinds of device, or halves of a keyboard, are two for sure.
    people = table.of_framed("source") == "human"
    columns = zip(*(table.of_framed(name).tolist() for name in _WHO), strict=True)
    devices = np.array([may_be_one_device(*who) for who in columns], bool)
    message = "both players gave the same actions: one device moved both"
    yield from each(table, found & devices, "identical", share, bound, "error", message, table.framed)
    message = "both players gave the same actions"
    yield from each(table, found & people & ~devices, "identical", share, bound, "warning", message, table.framed)
    yield from each(table, found & ~people, "identical", share, bound, "info", message, table.framed)


def _with_keys(table: EpisodeTable, player: int) -> np.ndarray:
    return np.char.find(np.char.lower(table.of_framed(f"controller_{player}")), "keyboard") >= 0


def _saturated(table: EpisodeTable) -> Iterator[Finding]:
    bound = limit("saturated")
    for player, name in enumerate(PLAYERS):
        share = table.share(np.abs(_action(table, player)).max(axis=1) > limit("saturated_force"))
        # A key knows nothing but its stop, and a player at keys is no mistake.
        keys = _with_keys(table, player)
        message = f"share of frames in which player {player} ({name}) was at the stop"
        yield from each(table, (share > bound) & ~keys, "saturated", share, bound, "warning", message, table.framed)
        yield from each(table, (share > bound) & keys, "saturated", share, bound, "info", message, table.framed)


def _action(table: EpisodeTable, player: int) -> np.ndarray:
    return table.frames[ACTION][:, 2 * player : 2 * player + 2]


RULES = (
    Rule("finite", "all numbers of the frames are finite", _finite, (STATE, ACTION)),
    Rule("action_range", "actions within a player's full force", _action_range, (ACTION,)),
    Rule("state_range", "the table in the window, its angle an angle", _state_range, (STATE,)),
    Rule("idle", "both players take part", _idle, (ACTION,), ("source",)),
    Rule(
        "identical",
        "the players do not act as one",
        _identical,
        (ACTION,),
        _WHO,
    ),
    Rule("saturated", "sticks are not always at their stop", _saturated, (ACTION,), ("controller_0", "controller_1")),
)
