"""Switches of leadership: the player whose actions precede the partner's changes."""

import itertools

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.statistics.leadership import HOP_S, WINDOW_S, lead_windows

from .motion import Event, Motion, least_frames

STEADY_S = 0.5
"""Time for which the same player leads before and after a switch, s."""


def leadership_switches(motion: Motion, order: Array | None) -> list[Event]:
    """Changes of the leader between two times of at least `STEADY_S` in which the leader stays the same.

    The leader of a window is that of `lead_windows`. The score is the smaller of the mean correlations before and
    after.
    """
    data, windows = motion.frames, lead_windows(motion.frames, order)
    hops_per_s = data.fps / max(1, round(HOP_S * data.fps))  # at low rates a hop is a frame, longer than `HOP_S`
    steady, window = least_frames(STEADY_S, hops_per_s), round(WINDOW_S * data.fps)
    events = []
    for episode in np.unique(windows.episode).tolist():
        inside = windows.episode == episode
        start, leader, correlation = (column[inside] for column in (windows.start, windows.leader, windows.correlation))
        bounds = np.flatnonzero(np.diff(leader, prepend=2, append=2))
        runs = [
            (first, end)
            for first, end in zip(bounds.tolist(), bounds[1:].tolist(), strict=False)
            if leader[first] and end - first >= steady
        ]
        for (first, end), (next_first, next_end) in itertools.pairwise(runs):
            if leader[first] == leader[next_first]:
                continue
            score = min(correlation[first:end].mean(), correlation[next_first:next_end].mean())
            names = [motion.task.spec.players[0 if sign > 0 else 1] for sign in (leader[first], leader[next_first])]
            offset = data.starts[episode]
            events.append(
                Event(
                    episode,
                    int(start[end - 1] - offset),
                    int(start[next_first] - offset) + window,
                    float(score),
                    {"from": names[0], "to": names[1]},
                )
            )
    return events
