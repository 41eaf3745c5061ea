"""Disagreement about the strategy, and adaptation: the players then prefer the same one.

A task says with which action each player would pursue each strategy in a state (`Studies.strategy_actions`; for the
table: the forces along each route). A player prefers the strategy whose action its own one follows best.
"""

import math

import numpy as np
from scipy.ndimage import uniform_filter1d

from copolicy.dataset.arrays import Array

from .motion import Event, Motion

MARGIN = 0.25
"""How much more of a player's action must follow the preferred strategy than any other one, in full actions."""

SMOOTHING_S = 0.5
"""Window of the mean over time, s."""

SHORTEST_S = 0.3
"""Shortest time of a disagreement, and of the agreement after it, s."""

WITHIN_S = 5.0
"""Longest time from a disagreement to the agreement, s."""

NOBODY = "nobody"


def preferences(labels: tuple[str, ...], wanted: Array, actions: Array, fps: int) -> tuple[Array, Array]:
    """Strategy that each player prefers in each frame of an episode.

    Args:
        labels: R strategies.
        wanted: `(T, 2, R, m)` actions that would pursue each strategy; NaN where one is out of reach.
        actions: `(T, 2, m)`.

    Returns:
        `(T, 2)` index of the strategy, -1 if several are followed equally well or only one is in reach; `(T, 2)` margin
        over the second best, 0 where the index is -1.
    """
    if len(labels) < 2:
        return np.full(wanted.shape[:2], -1), np.zeros(wanted.shape[:2])
    reach = ~np.isnan(wanted).any(axis=-1)
    directions = wanted / np.maximum(np.linalg.norm(wanted, axis=-1, keepdims=True), 1e-9)
    followed = np.einsum("tpm,tprm->tpr", actions, np.nan_to_num(directions))
    smooth = uniform_filter1d(followed, max(1, round(SMOOTHING_S * fps)), axis=0, mode="constant")
    smooth = np.where(reach, smooth, -math.inf)
    choice = reach.sum(axis=-1) > 1
    ordered = np.sort(smooth, axis=-1)
    margin = np.zeros(choice.shape)
    np.subtract(ordered[..., -1], ordered[..., -2], out=margin, where=choice)
    decided = margin >= MARGIN
    return np.where(decided, smooth.argmax(axis=-1), -1), np.where(decided, margin, 0.0)


def disagreements(motion: Motion, order: Array | None) -> list[Event]:
    """Times in which both players prefer a strategy, and not the same one.

    The details say which one was `robot`'s and `human`'s, the `common` one on which both agree within `WITHIN_S` after
    it (empty if they do not), and who `gave_way`: the player or players with another preference before. The score is
    the integral of the smaller margin over time.
    """
    data = motion.frames
    actions = np.stack(np.split(motion.task.spec.full_forces(motion.joint_actions(order)), 2, axis=1), axis=1)
    preferred = np.full((len(data.states), 2), -1)
    margins = np.zeros((len(data.states), 2))
    for (labels, wanted), start, end in zip(motion.strategy_actions, data.starts, data.ends, strict=True):
        preferred[start:end], margins[start:end] = preferences(labels, wanted, actions[start:end], data.fps)
    decided = (preferred >= 0).all(axis=1)
    differ = decided & (preferred[:, 0] != preferred[:, 1])
    agreements = motion.runs(decided & ~differ, SHORTEST_S)
    events = []
    for episode, first, end in motion.runs(differ, SHORTEST_S):
        offset, labels = data.starts[episode], motion.strategy_actions[episode][0]
        during = preferred[offset + first : offset + end]
        own = [labels[int(np.bincount(during[:, seat]).argmax())] for seat in (0, 1)]
        later = [run for run in agreements if run[0] == episode and 0 <= run[1] - end <= WITHIN_S * data.fps]
        common = labels[preferred[offset + later[0][1], 0]] if later else ""
        yielding = [name for name, label in zip(motion.task.spec.players, own, strict=True) if label != common]
        details = {
            **dict(zip(motion.task.spec.players, own, strict=True)),
            "common": common,
            "gave_way": " and ".join(yielding) if common else NOBODY,
        }
        score = float(margins[offset + first : offset + end].min(axis=1).sum() / data.fps)
        last = later[0][2] if later else end
        events.append(Event(episode, first, min(last, end + round(WITHIN_S * data.fps)), score, details))
    return events


def adaptations(motion: Motion, order: Array | None) -> list[Event]:
    """Disagreements after which the players agree."""
    return [event for event in disagreements(motion, order) if event.details["common"]]


def robot_gave_way(motion: Motion) -> Array:
    """`(E, 2)` number of adaptations of each episode, and of those in which the robot gave way, alone or as well."""
    robot = motion.task.spec.players[0]
    counts = np.zeros((len(motion.frames.rows), 2), int)
    for event in adaptations(motion, None):
        counts[event.episode] += (1, event.details[robot] != event.details["common"])
    return counts
