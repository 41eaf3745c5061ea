"""Who leads: whose action runs ahead of the partner's, how often that changes, against players turned in time."""

from dataclasses import replace

import numpy as np

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
    f"partner's over lags up to {MAX_LAG_S:.2f} s either way (each less its mean over the episode{{axes}}), has its "
    "largest correlation ahead of it; none where that is at lag 0 or not positive."
)
_NULL = f"player 1 turned in time within each episode by at least {MIN_SHIFT_S:g} s"


def leaders(data: Trajectories, order: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Leader of each window and the window's episode.

    Args:
        order: `(N,)` frames that stand in for player 1's own, for the null.

    Returns:
        `(W,)` +1 where player 0 leads, -1 where player 1 does, 0 for none; `(W,)` episodes.
    """
    # A row an axis: contiguous, and no sum over an axis of two.
    one, two = (_centred(data, data.player_force(player)).T.copy() for player in (0, 1))
    two = two if order is None else two.take(order, axis=1)
    count = one.shape[1]
    window, reach = max(2, round(WINDOW_S * data.fps)), max(1, round(MAX_LAG_S * data.fps))
    offset = np.arange(count) - data.starts[data.episode]
    inside = (offset >= reach) & (offset + window + reach <= data.lengths[data.episode])
    begin = np.flatnonzero(inside & ((offset - reach) % max(1, round(HOP_S * data.fps)) == 0))
    if not len(begin):
        return np.zeros(0, dtype=int), data.episode[begin]
    energy_one = _windowed(_added(one**2), begin, window)
    total_two = np.concatenate(([0.0], np.cumsum(_added(two**2), dtype=float)))
    best, lag_of_best = np.zeros(len(begin)), np.zeros(len(begin), dtype=int)
    product = np.zeros(count)
    # Lag 0 first, then outwards: a tie goes to the smaller lag.
    for lag in sorted(range(-reach, reach + 1), key=abs):
        here, there = slice(max(0, -lag), count - max(0, lag)), slice(max(0, lag), count - max(0, -lag))
        product[:] = 0.0
        product[here] = _added(one[:, here] * two[:, there])
        scale = np.sqrt(energy_one * (total_two[begin + lag + window] - total_two[begin + lag]))
        together = _windowed(product, begin, window)
        correlation = np.divide(together, scale, out=np.zeros(len(begin)), where=scale > 1e-9)
        better = correlation > best + 1e-9
        best[better], lag_of_best[better] = correlation[better], lag
    return np.sign(lag_of_best), data.episode[begin]


def leadership_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Share of windows that player 0 leads, and changes of leader a minute."""
    lead, episode = leaders(data)
    axes = data.axes and f"{data.axes} together"
    lead_definition = _LEAD.format(axes=axes)
    leading, decided, switches, minutes = _per_episode(data, lead, episode)
    share_definition = f"{lead_definition} Share of the windows with a leader in which player 0 leads."
    switch_definition = f"{lead_definition} Changes of leader a minute between windows with one."
    if not decided.any():
        note = f"no episode is long enough for a window of {WINDOW_S:g} s, or nobody moves"
        return {
            "leadership_share": Estimate(None, "1", share_definition, 0, note=note),
            "leadership_switches": Estimate(None, "1/min", switch_definition, 0, note=note),
        }
    shares, rates = [], []
    for _ in range(SHIFTS):
        order = circular_shift(data.starts, data.lengths, round(MIN_SHIFT_S * data.fps), rng)
        turned = _per_episode(data, *leaders(data, order))
        shares.append(turned[0].sum() / max(turned[1].sum(), 1))
        rates.append(turned[2].sum() / turned[3].sum())
    episodes, counted = int((decided > 0).sum()), {"windows": len(lead), "windows_with_leader": int(decided.sum())}
    share = bootstrap.estimate(leading, decided, "1", share_definition, episodes, details=counted)
    noisy = switch_definition + " Noise switches often: hold it against its null."
    rate = bootstrap.estimate(switches, minutes, "1/min", noisy, episodes)
    return {
        name: replace(estimate, null=Null.from_draws(_NULL, estimate.value or 0.0, np.array(draws), two_sided=True))
        for name, estimate, draws in (("leadership_share", share, shares), ("leadership_switches", rate, rates))
    }


def _per_episode(data: Trajectories, lead: np.ndarray, episode: np.ndarray) -> tuple[np.ndarray, ...]:
    """Windows that player 0 leads, windows with a leader, changes, and minutes under windows, of each episode."""
    count = len(data.rows)
    leading = np.bincount(episode[lead > 0], minlength=count).astype(float)
    decided = np.bincount(episode[lead != 0], minlength=count).astype(float)
    side, where = lead[lead != 0], episode[lead != 0]
    changed = (side[1:] != side[:-1]) & (where[1:] == where[:-1])
    switches = np.bincount(where[1:][changed], minlength=count).astype(float)
    hop = max(1, round(HOP_S * data.fps)) / data.fps
    minutes = np.bincount(episode, minlength=count) * hop / 60
    return leading, decided, switches, minutes


def _centred(data: Trajectories, actions: np.ndarray) -> np.ndarray:
    """`(N, m)` less their mean over each episode."""
    sums = np.column_stack([data.per_episode(column) for column in actions.T])
    return actions - (sums / data.lengths[:, None])[data.episode].astype(actions.dtype)


def _added(rows: np.ndarray) -> np.ndarray:
    """Sum of `(m, N)` over its few rows, one after the other."""
    total = rows[0]
    for row in rows[1:]:
        total = total + row
    return total


def _windowed(values: np.ndarray, begin: np.ndarray, window: int) -> np.ndarray:
    """Sums of `values` over the windows that begin at some frames."""
    total = np.concatenate(([0.0], np.cumsum(values, dtype=float)))
    return total[begin + window] - total[begin]
