"""Leadership: the player whose action precedes the partner's in cross-correlation, and how often the leader changes."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from .estimate import Estimate, Null
from .resampling import Bootstrap, circular_shift
from .trajectories import Trajectories

WINDOW_S = 1.0
MAX_LAG_S = 1 / 3
HOP_S = 0.1
MIN_SHIFT_S = 2.0
SHIFTS = 39

_LEAD = (
    f"Leader of a window of {WINDOW_S:g} s, every {HOP_S:g} s: the player whose action, cross-correlated with the "
    f"partner's over lags of up to {MAX_LAG_S:.2f} s both ways (each minus its mean over the episode{{axes}}), "
    "precedes it at the largest correlation; none if that is at lag 0 or not positive."
)
_NULL = f"player 1's actions circularly shifted in time within each episode by at least {MIN_SHIFT_S:g} s"


class LeadWindows(NamedTuple):
    """The windows of all episodes, in order.

    Attributes:
        start: `(W,)` first frame of each window.
        episode: `(W,)` episode index.
        leader: `(W,)` +1 if player 0 leads, -1 if player 1 leads, 0 for none.
        correlation: `(W,)` largest correlation; 0 if none is positive.
    """

    start: Array
    episode: Array
    leader: Array
    correlation: Array


def lead_windows(data: Trajectories, order: Array | None = None) -> LeadWindows:
    """Leader of each window.

    Args:
        order: `(N,)` frame indices by which player 1's actions are reordered, for the null distribution.
    """
    # One contiguous row per axis is faster than sums over an axis of length two.
    first, second = (_centred(data, data.player_force(player)).T.copy() for player in (0, 1))
    second = second if order is None else second.take(order, axis=1)
    count = first.shape[1]
    window, max_lag = max(2, round(WINDOW_S * data.fps)), max(1, round(MAX_LAG_S * data.fps))
    offset = np.arange(count) - data.starts[data.episode]
    inside = (offset >= max_lag) & (offset + window + max_lag <= data.lengths[data.episode])
    starts = np.flatnonzero(inside & ((offset - max_lag) % max(1, round(HOP_S * data.fps)) == 0))
    if not len(starts):
        return LeadWindows(starts, data.episode[starts], np.zeros(0, dtype=int), np.zeros(0))
    first_energy = _window_sums(_sum_rows(first**2), starts, window)
    second_energy_sum = np.concatenate(([0.0], np.cumsum(_sum_rows(second**2), dtype=float)))
    best, lag_of_best = np.zeros(len(starts)), np.zeros(len(starts), dtype=int)
    product = np.zeros(count)
    # In order of the absolute lag, so that a tie goes to the smaller one.
    for lag in sorted(range(-max_lag, max_lag + 1), key=abs):
        first_frames, second_frames = slice(max(0, -lag), count - max(0, lag)), slice(max(0, lag), count - max(0, -lag))
        product[:] = 0.0
        product[first_frames] = _sum_rows(first[:, first_frames] * second[:, second_frames])
        scale = np.sqrt(first_energy * (second_energy_sum[starts + lag + window] - second_energy_sum[starts + lag]))
        covariance = _window_sums(product, starts, window)
        correlation = np.divide(covariance, scale, out=np.zeros(len(starts)), where=scale > 1e-9)
        improved = correlation > best + 1e-9
        best[improved], lag_of_best[improved] = correlation[improved], lag
    return LeadWindows(starts, data.episode[starts], np.sign(lag_of_best), best)


def leadership_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Proportion of windows in which player 0 leads, and changes of leader per minute."""
    windows = lead_windows(data)
    leader, episode = windows.leader, windows.episode
    axes = data.axes and f"{data.axes} together"
    lead_definition = _LEAD.format(axes=axes)
    leading, decided, switches, minutes = _per_episode(data, leader, episode)
    share_definition = f"{lead_definition} Proportion of the windows with a leader in which player 0 leads."
    switch_definition = f"{lead_definition} Changes of leader per minute between windows with a leader."
    if not decided.any():
        note = f"no episode is long enough for a window of {WINDOW_S:g} s, or nobody moves"
        return {
            "leadership_share": Estimate(None, "1", share_definition, 0, note=note),
            "leadership_switches": Estimate(None, "1/min", switch_definition, 0, note=note),
        }
    share_draws, rate_draws = [], []
    for _ in range(SHIFTS):
        order = circular_shift(data.starts, data.lengths, round(MIN_SHIFT_S * data.fps), rng)
        shifted_windows = lead_windows(data, order)
        shifted = _per_episode(data, shifted_windows.leader, shifted_windows.episode)
        share_draws.append(shifted[0].sum() / max(shifted[1].sum(), 1))
        rate_draws.append(shifted[2].sum() / shifted[3].sum())
    episodes, counted = int((decided > 0).sum()), {"windows": len(leader), "windows_with_leader": int(decided.sum())}
    share = bootstrap.estimate(leading, decided, "1", share_definition, episodes, details=counted)
    noisy = switch_definition + " Noise alone switches often: compare it with its null distribution."
    rate = bootstrap.estimate(switches, minutes, "1/min", noisy, episodes)
    return {
        name: replace(estimate, null=Null.from_draws(_NULL, estimate.value or 0.0, np.array(draws), two_sided=True))
        for name, estimate, draws in (
            ("leadership_share", share, share_draws),
            ("leadership_switches", rate, rate_draws),
        )
    }


def _per_episode(data: Trajectories, leader: Array, episode: Array) -> tuple[Array, ...]:
    """For each episode: windows that player 0 leads, windows with a leader, changes of leader, minutes of windows."""
    count = len(data.rows)
    leading = np.bincount(episode[leader > 0], minlength=count).astype(float)
    decided = np.bincount(episode[leader != 0], minlength=count).astype(float)
    side, side_episode = leader[leader != 0], episode[leader != 0]
    changed = (side[1:] != side[:-1]) & (side_episode[1:] == side_episode[:-1])
    switches = np.bincount(side_episode[1:][changed], minlength=count).astype(float)
    hop = max(1, round(HOP_S * data.fps)) / data.fps
    minutes = np.bincount(episode, minlength=count) * hop / 60
    return leading, decided, switches, minutes


def _centred(data: Trajectories, actions: Array) -> Array:
    """Actions `(N, m)` minus their mean over each episode."""
    sums = np.column_stack([data.per_episode(column) for column in actions.T])
    return actions - (sums / data.lengths[:, None])[data.episode].astype(actions.dtype)


def _sum_rows(rows: Array) -> Array:
    """Sum `(N,)` over the rows of `(m, N)`; faster than `sum` for few rows."""
    total = rows[0]
    for row in rows[1:]:
        total = total + row
    return total


def _window_sums(values: Array, starts: Array, window: int) -> Array:
    """Sums of `values` over the windows that begin at the frames `starts`."""
    total = np.concatenate(([0.0], np.cumsum(values, dtype=float)))
    return total[starts + window] - total[starts]
