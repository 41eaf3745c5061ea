"""k-nearest-neighbour conditional action variance: the variance of the action among similar states of other episodes.

It estimates Var(action | state), with two corrections. Frames of one episode have similar actions, which biases the
variance down: only the nearest frame of each other episode is used. Neighbours differ from the query state, and the
change of the action with the state biases the variance up, to first order in proportion to the mean square spread of
the neighbours: the variance is computed for several numbers of neighbours and extrapolated to a spread of zero.
"""

import numpy as np
from scipy.spatial import KDTree

from ..arrays import Array
from .estimate import Estimate
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

NEIGHBOUR_COUNTS = (2, 4, 8)
"""Numbers of neighbouring episodes from which the variance is extrapolated; a query needs the largest number."""

_BLOCK_SIZE = 2000
_FIRST_K = 64
MAX_QUERIES = 20_000
MAX_FRAMES = 200_000
"""Frames that are searched for neighbours; a larger data set is subsampled evenly."""


def variance_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Ratio of the conditional to the total action variance, for both players together and for each."""
    searched = np.unique(np.linspace(0, len(data.states) - 1, min(MAX_FRAMES, len(data.states))).astype(int))
    is_query = np.zeros(len(data.states), dtype=bool)
    is_query[rng.choice(searched, min(MAX_QUERIES, len(searched)), replace=False)] = True
    low, high = data.task.spec.state.bounds
    scaled = (2 * (data.states - low) / (high - low) - 1).astype(np.float32)
    # Sums over the queries of each episode, for each number of neighbours.
    width = len(data.task.spec.action)
    variances = np.zeros((len(NEIGHBOUR_COUNTS), len(data.rows), 2 * width))
    spreads = np.zeros((len(NEIGHBOUR_COUNTS), len(data.rows)))
    queries = np.zeros(len(data.rows))
    is_searched = np.zeros(len(data.states), dtype=bool)
    is_searched[searched] = True
    for group in data.groups(with_goal=True):
        in_group = np.isin(data.episode, group)
        frames, query_indices = np.flatnonzero(in_group & is_searched), np.flatnonzero(in_group & is_query)
        if len(group) < 2 or not len(query_indices):
            continue
        neighbours = _nearest_frames(scaled, data.episode, frames, query_indices)
        complete = (neighbours >= 0).all(axis=1)
        query_episodes = data.episode[query_indices[complete]]
        for row, count in enumerate(NEIGHBOUR_COUNTS):
            nearest = neighbours[complete, :count]
            np.add.at(variances[row], query_episodes, _variance(data.actions, nearest))
            np.add.at(spreads[row], query_episodes, _variance(scaled, nearest).sum(axis=1))
        np.add.at(queries, query_episodes, 1)
    return {
        name: _ratio(data, bootstrap, variances, spreads, queries, columns, description)
        for name, columns, description in (
            ("action_variance_ratio", slice(0, 2 * width), "both players' actions"),
            ("action_variance_ratio_player_0", slice(0, width), "player 0's action"),
            ("action_variance_ratio_player_1", slice(width, 2 * width), "player 1's action"),
        )
    }


def _nearest_frames(scaled: Array, episode: Array, frames: Array, queries: Array) -> Array:
    """`(Q, k)` nearest frame of each of the k nearest other episodes, for each query `(Q,)`; -1 if there are fewer."""
    count = NEIGHBOUR_COUNTS[-1]
    result = np.full((len(queries), count), -1)
    if len(frames) < count:
        return result
    tree = KDTree(scaled[frames])
    for begin in range(0, len(queries), _BLOCK_SIZE):
        pending = np.arange(begin, min(begin + _BLOCK_SIZE, len(queries)))
        k = min(_FIRST_K, len(frames))
        while len(pending):
            nearest = frames[tree.query(scaled[queries[pending]], k=k)[1].reshape(len(pending), -1)]
            columns = _first_per_episode(episode[nearest], episode[queries[pending]])[:, :count]
            complete = columns[:, -1] < k
            result[pending[complete]] = np.take_along_axis(nearest[complete], columns[complete], axis=1)
            pending = pending[~complete]
            if k == len(frames):
                break
            k = min(4 * k, len(frames))
    return result


def _first_per_episode(episodes: Array, own_episodes: Array) -> Array:
    """`(Q, k)` columns of `episodes` `(Q, k)` where an episode other than the own `(Q,)` comes first, padded with k."""
    order = np.argsort(episodes, axis=1, kind="stable")
    ordered = np.take_along_axis(episodes, order, axis=1)
    first = ordered != own_episodes[:, None]
    first[:, 1:] &= ordered[:, 1:] != ordered[:, :-1]
    return np.sort(np.where(first, order, episodes.shape[1]), axis=1)


def _variance(values: Array, neighbours: Array) -> Array:
    """`(Q, n)` variance of each column of `(N, n)` among the neighbours `(Q, k)` of each query."""
    # Column by column, to save the memory of Q k n numbers.
    return np.column_stack([values[:, axis][neighbours].var(axis=1, ddof=1) for axis in range(values.shape[1])])


def _at_zero_spread(variances: Array, spreads: Array) -> Array:
    """`(B,)` intercepts of linear fits of `(K, B)` variances over `(K, B)` spreads, at least 0."""
    deviations = spreads - spreads.mean(axis=0)
    squares = (deviations**2).sum(axis=0)
    slope = np.divide((deviations * variances).sum(axis=0), squares, out=np.zeros_like(squares), where=squares > 1e-18)
    return np.maximum(0.0, variances.mean(axis=0) - slope * spreads.mean(axis=0))


def _ratio(data: Trajectories, bootstrap: Bootstrap, variances, spreads, queries, columns, subject: str) -> Estimate:
    numbers = ", ".join(map(str, NEIGHBOUR_COUNTS))
    definition = (
        f"k-nearest-neighbour conditional action variance: mean variance of {subject} among the nearest states of "
        "other episodes with the same goal and obstacles, one per episode, divided by their total variance: 0 if the "
        "state determines the action, 1 (the null, by construction) if they are independent. States are scaled from "
        f"the task's bounds to [-1, 1]. The variance among {numbers} neighbours is extrapolated linearly in their mean "
        "square spread to a spread of zero; with few episodes a bias towards that of distant neighbours remains."
    )
    episodes = int((queries > 0).sum())
    if not episodes:
        note = f"no goal and obstacles with {NEIGHBOUR_COUNTS[-1] + 1} episodes"
        return Estimate(None, "1", definition, 0, note=note)
    actions = data.actions[:, columns]
    sums = np.column_stack([data.per_episode(actions[:, axis]) for axis in range(actions.shape[1])])
    squares = data.per_episode((actions.astype(float) ** 2).sum(axis=1))
    sums_within = variances[:, :, columns].sum(axis=2)

    def ratios(weights: Array) -> Array:
        """`(1 + K, B)` ratio extrapolated to zero spread, and the ratio for each number of neighbours."""
        frames = weights @ data.lengths
        total = (weights @ squares) / frames - (((weights @ sums) / frames[:, None]) ** 2).sum(axis=1)
        total_queries = weights @ queries
        within_variances = sums_within @ weights.T / total_queries
        extrapolated = _at_zero_spread(within_variances, spreads @ weights.T / total_queries)
        return np.vstack((extrapolated, within_variances)) / total

    all_episodes = np.ones((1, len(data.rows)))
    usable_weights = bootstrap.weights[(bootstrap.weights @ queries) > 0]
    frames = len(data.actions)
    if not squares.sum() / frames - ((sums.sum(axis=0) / frames) ** 2).sum() > 1e-12:
        return Estimate(None, "1", definition, episodes, note="the actions never change")
    value, *within_variances = ratios(all_episodes)[:, 0].tolist()
    bounds = interval(value, ratios(usable_weights.astype(float))[0], 0.0)
    details = {"among_episodes": dict(zip(map(str, NEIGHBOUR_COUNTS), within_variances, strict=True))}
    return Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, details=details)
