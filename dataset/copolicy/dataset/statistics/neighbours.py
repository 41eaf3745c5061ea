"""How far the action is settled by the state: its variance among the nearest states of other episodes."""

import numpy as np
from scipy.spatial import KDTree

from ..features import BOUNDS, STATE
from .estimate import Estimate
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

NEIGHBOURS = 64
MAX_QUERIES = 20_000
MAX_FRAMES = 200_000
"""Frames that are searched; of a larger data set, an even selection."""


def neighbour_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """The ratio of variances for both players together and for each."""
    kept = np.unique(np.linspace(0, len(data.states) - 1, min(MAX_FRAMES, len(data.states))).astype(int))
    chosen = np.zeros(len(data.states), dtype=bool)
    chosen[rng.choice(kept, min(MAX_QUERIES, len(kept)), replace=False)] = True
    low, high = BOUNDS[STATE]
    scaled = (2 * (data.states - low) / (high - low) - 1).astype(np.float32)
    within = np.zeros((len(data.rows), 4))  # sum over queries of the neighbours' variance
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
        variance = np.empty((int(found.sum()), 4))
        for axis in range(4):
            variance[:, axis] = data.actions[neighbours[found], axis].var(axis=1, ddof=1)
        np.add.at(within, data.episode[asked[found]], variance)
        np.add.at(queries, data.episode[asked[found]], 1)
    return {
        name: _ratio(data, bootstrap, within, queries, columns, who)
        for name, columns, who in (
            ("action_variance_ratio", slice(0, 4), "both players' actions"),
            ("action_variance_ratio_player_0", slice(0, 2), "player 0's action"),
            ("action_variance_ratio_player_1", slice(2, 4), "player 1's action"),
        )
    }


def _others(scaled: np.ndarray, episode: np.ndarray, frames: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """`(len(asked), k)` the nearest frames of other episodes, -1 where a group has too few of them."""
    tree = KDTree(scaled[frames])
    result = np.full((len(asked), NEIGHBOURS), -1)
    missing = np.arange(len(asked))
    reach = min(3 * NEIGHBOURS, len(frames))
    while len(missing):
        near = frames[tree.query(scaled[asked[missing]], k=reach)[1].reshape(len(missing), -1)]
        other = episode[near] != episode[asked[missing], None]
        enough = other.sum(axis=1) >= NEIGHBOURS
        # Nearest first: the first k of other episodes.
        rank = np.cumsum(other, axis=1)
        picked = other & (rank <= NEIGHBOURS)
        result[missing[enough]] = near[enough][picked[enough]].reshape(-1, NEIGHBOURS)
        missing = missing[~enough]
        if reach == len(frames):
            break
        reach = min(4 * reach, len(frames))
    return result


def _ratio(data: Trajectories, bootstrap: Bootstrap, within, queries, columns: slice, who: str) -> Estimate:
    definition = (
        f"Mean variance of {who} among the {NEIGHBOURS} nearest states of other episodes with the same goal and "
        "obstacles, over their variance in all: 0 where the state settles the action, 1 (the null, by construction) "
        "where it tells nothing. States in the task's bounds scaled to [-1, 1]; frames of the same episode never "
        "count. Neighbours lie beside the state, not on it: with few episodes the ratio leans upward."
    )
    episodes = int((queries > 0).sum())
    if not episodes:
        note = f"no goal and obstacles with {NEIGHBOURS} frames in other episodes"
        return Estimate(None, "1", definition, 0, note=note)
    actions = data.actions[:, columns]
    sums = np.column_stack([data.per_episode(actions[:, axis]) for axis in range(actions.shape[1])])
    squares = data.per_episode((actions.astype(float) ** 2).sum(axis=1))

    def ratio(weights: np.ndarray) -> np.ndarray:
        frames = weights @ data.lengths
        total = (weights @ squares) / frames - (((weights @ sums) / frames[:, None]) ** 2).sum(axis=1)
        neighbours = (weights @ within[:, columns].sum(axis=1)) / (weights @ queries)
        return neighbours / total

    everything = np.ones((1, len(data.rows)))
    drawn = bootstrap.weights[(bootstrap.weights @ queries) > 0]
    frames = len(data.actions)
    if not squares.sum() / frames - ((sums.sum(axis=0) / frames) ** 2).sum() > 1e-12:
        return Estimate(None, "1", definition, episodes, note="the actions never change")
    value = float(ratio(everything)[0])
    bounds = interval(value, ratio(drawn.astype(float)), 0.0)
    return Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled)
