"""How much each player does: idle and saturated input."""

import numpy as np

from ..task import PLAYERS
from .estimate import Estimate
from .resampling import Bootstrap
from .trajectories import Trajectories

IDLE_BELOW = 0.1
SATURATED_ABOVE = 0.98


def activity_statistics(data: Trajectories, bootstrap: Bootstrap) -> dict[str, Estimate]:
    """Idle and saturated share of each player's frames."""
    estimates = {}
    frames = data.lengths.astype(float)
    for player, seat in enumerate(PLAYERS):
        action = data.actions[:, 2 * player : 2 * player + 2]
        idle = np.linalg.norm(action, axis=1) < IDLE_BELOW
        saturated = np.abs(action).max(axis=1) > SATURATED_ABOVE
        longest = longest_runs(idle, data.starts, data.lengths) / data.fps
        share, bounds = bootstrap.ratio(data.per_episode(idle), frames)
        estimates[f"idle_player_{player}"] = Estimate(
            share,
            "1",
            f"Share of frames in which player {player} ({seat} seat) applies less than {IDLE_BELOW:g} of a full force.",
            len(data.rows),
            bounds,
            bootstrap.resampled,
            details={"longest_s": float(longest.max()), "median_longest_of_an_episode_s": float(np.median(longest))},
        )
        share, bounds = bootstrap.ratio(data.per_episode(saturated), frames)
        estimates[f"saturation_player_{player}"] = Estimate(
            share,
            "1",
            f"Share of frames in which a component of player {player}'s force ({seat} seat) is over "
            f"{SATURATED_ABOVE:g} of the full force.",
            len(data.rows),
            bounds,
            bootstrap.resampled,
        )
    return estimates


def longest_runs(flags: np.ndarray, starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """`(E,)` longest run of true frames in each episode."""
    longest = np.zeros(len(starts), dtype=int)
    for index, (start, length) in enumerate(zip(starts.tolist(), lengths.tolist(), strict=True)):
        edges = np.flatnonzero(np.diff(flags[start : start + length].astype(np.int8), prepend=0, append=0))
        if len(edges):
            longest[index] = (edges[1::2] - edges[::2]).max()
    return longest
