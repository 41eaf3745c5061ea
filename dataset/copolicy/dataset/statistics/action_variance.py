"""How far the action is settled by the state: its variance among the nearest states of other episodes.

Two things would make that variance another one than that of the action given the state. Neighbouring frames of one
episode have neighbouring actions, so that many of them vary too little: each other episode gives one frame, its
nearest. And neighbours lie beside a state, not on it, so that what the action does from state to state adds to its
variance: to first order by the mean square of the neighbours' own spread, which is measured, so that the variance is
found for several numbers of neighbours and followed to a spread of zero.
"""

import numpy as np
from scipy.spatial import KDTree

from .estimate import Estimate
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

NEIGHBOURS = (2, 4, 8)
"""The variance is followed along these numbers of other episodes; the last must be there."""

_BLOCK = 2000
_FIRST_REACH = 64
MAX_QUERIES = 20_000
MAX_FRAMES = 200_000
"""Frames that are searched; of a larger data set, an even selection."""


def variance_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """The ratio of variances for both players together and for each."""
    kept = np.unique(np.linspace(0, len(data.states) - 1, min(MAX_FRAMES, len(data.states))).astype(int))
    chosen = np.zeros(len(data.states), dtype=bool)
    chosen[rng.choice(kept, min(MAX_QUERIES, len(kept)), replace=False)] = True
    low, high = data.task.spec.state.bounds
    scaled = (2 * (data.states - low) / (high - low) - 1).astype(np.float32)
    # Sums over the queries of each episode, for each number of neighbours.
    width = len(data.task.spec.action)
    variances = np.zeros((len(NEIGHBOURS), len(data.rows), 2 * width))
    spreads = np.zeros((len(NEIGHBOURS), len(data.rows)))
    queries = np.zeros(len(data.rows))
    keep_frame = np.zeros(len(data.states), dtype=bool)
    keep_frame[kept] = True
    for group in data.groups(with_goal=True):
        member = np.isin(data.episode, group)
        frames, asked = np.flatnonzero(member & keep_frame), np.flatnonzero(member & chosen)
        if len(group) < 2 or not len(asked):
            continue
        neighbours = _others(scaled, data.episode, frames, asked)
        found = (neighbours >= 0).all(axis=1)
        of = data.episode[asked[found]]
        for place, count in enumerate(NEIGHBOURS):
            near = neighbours[found, :count]
            np.add.at(variances[place], of, _variance(data.actions, near))
            np.add.at(spreads[place], of, _variance(scaled, near).sum(axis=1))
        np.add.at(queries, of, 1)
    return {
        name: _ratio(data, bootstrap, variances, spreads, queries, columns, who)
        for name, columns, who in (
            ("action_variance_ratio", slice(0, 2 * width), "both players' actions"),
            ("action_variance_ratio_player_0", slice(0, width), "player 0's action"),
            ("action_variance_ratio_player_1", slice(width, 2 * width), "player 1's action"),
        )
    }


def _others(scaled: np.ndarray, episode: np.ndarray, frames: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """`(len(asked), k)` nearest frame of each of the k nearest other episodes; -1 where a group has too few of them."""
    most = NEIGHBOURS[-1]
    result = np.full((len(asked), most), -1)
    if len(frames) < most:
        return result
    tree = KDTree(scaled[frames])
    for begin in range(0, len(asked), _BLOCK):
        missing = np.arange(begin, min(begin + _BLOCK, len(asked)))
        reach = min(_FIRST_REACH, len(frames))
        while len(missing):
            near = frames[tree.query(scaled[asked[missing]], k=reach)[1].reshape(len(missing), -1)]
            places = _first_of_each(episode[near], episode[asked[missing]])[:, :most]
            enough = places[:, -1] < reach
            result[missing[enough]] = np.take_along_axis(near[enough], places[enough], axis=1)
            missing = missing[~enough]
            if reach == len(frames):
                break
            reach = min(4 * reach, len(frames))
    return result


def _first_of_each(episodes: np.ndarray, own: np.ndarray) -> np.ndarray:
    """`(Q, k)` places in the rows `(Q, k)` where an episode other than `own` `(Q,)` comes first, then k for none."""
    order = np.argsort(episodes, axis=1, kind="stable")
    ordered = np.take_along_axis(episodes, order, axis=1)
    first = ordered != own[:, None]
    first[:, 1:] &= ordered[:, 1:] != ordered[:, :-1]
    return np.sort(np.where(first, order, episodes.shape[1]), axis=1)


def _variance(values: np.ndarray, near: np.ndarray) -> np.ndarray:
    """`(Q, n)` variance of each column of `(N, n)` among the neighbours `(Q, k)` of each query."""
    # Column by column: all at once would hold Q k n numbers.
    return np.column_stack([values[:, axis][near].var(axis=1, ddof=1) for axis in range(values.shape[1])])


def _at_no_spread(variances: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    """`(B,)` variance where a line through `(K, B)` variances over `(K, B)` spreads meets a spread of zero."""
    away = spreads - spreads.mean(axis=0)
    square = (away**2).sum(axis=0)
    slope = np.divide((away * variances).sum(axis=0), square, out=np.zeros_like(square), where=square > 1e-18)
    return np.maximum(0.0, variances.mean(axis=0) - slope * spreads.mean(axis=0))


def _ratio(data: Trajectories, bootstrap: Bootstrap, variances, spreads, queries, columns: slice, who: str) -> Estimate:
    numbers = ", ".join(map(str, NEIGHBOURS))
    definition = (
        f"Mean variance of {who} among the nearest states of other episodes with the same goal and obstacles, one of "
        "each episode, over their variance in all: 0 where the state settles the action, 1 (the null, by construction) "
        f"where it tells nothing. States in the task's bounds scaled to [-1, 1]. The variance among {numbers} of them "
        "is followed along a line in the mean square of their spread to a spread of zero, since neighbours lie beside "
        "the state, not on it; with few episodes the ratio still leans to that of far neighbours."
    )
    episodes = int((queries > 0).sum())
    if not episodes:
        note = f"no goal and obstacles with {NEIGHBOURS[-1] + 1} episodes"
        return Estimate(None, "1", definition, 0, note=note)
    actions = data.actions[:, columns]
    sums = np.column_stack([data.per_episode(actions[:, axis]) for axis in range(actions.shape[1])])
    squares = data.per_episode((actions.astype(float) ** 2).sum(axis=1))
    within = variances[:, :, columns].sum(axis=2)

    def ratios(weights: np.ndarray) -> np.ndarray:
        """`(1 + K, B)` followed to no spread, and as it is among each number of neighbours."""
        frames = weights @ data.lengths
        total = (weights @ squares) / frames - (((weights @ sums) / frames[:, None]) ** 2).sum(axis=1)
        asked = weights @ queries
        among = within @ weights.T / asked
        return np.vstack((_at_no_spread(among, spreads @ weights.T / asked), among)) / total

    everything = np.ones((1, len(data.rows)))
    drawn = bootstrap.weights[(bootstrap.weights @ queries) > 0]
    frames = len(data.actions)
    if not squares.sum() / frames - ((sums.sum(axis=0) / frames) ** 2).sum() > 1e-12:
        return Estimate(None, "1", definition, episodes, note="the actions never change")
    value, *among = ratios(everything)[:, 0].tolist()
    bounds = interval(value, ratios(drawn.astype(float))[0], 0.0)
    details = {"among_episodes": {str(count): ratio for count, ratio in zip(NEIGHBOURS, among, strict=True)}}
    return Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, details=details)
