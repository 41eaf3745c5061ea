"""How far two parts of a data set are apart in states and actions: splits, early and late, pairs."""

from itertools import combinations

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import false_discovery_control

from .estimate import Estimate, Null
from .resampling import exchangeable, interval, permuted_within
from .trajectories import Trajectories

MAX_FRAMES = 4_000
MAX_EPISODES = 1_000
MAX_TABLE = 12
"""Pairs up to which each two are compared; of more, all at once alone."""

_PERMUTATIONS = 499
_REPLICATES = 200
_DISTANCE = (
    "Energy coefficient (2 E|X-Y| - E|X-X'| - E|Y-Y'|) / 2 E|X-Y| of states and actions, both in the task's bounds "
    "scaled to [-1, 1]: 0 the same distribution, 1 no overlap (Szekely and Rizzo 2013). Every episode counts alike."
)


def energy_statistics(data: Trajectories, rng: np.random.Generator) -> dict[str, Estimate]:
    """Between splits, or between earlier and later episodes where there is one split, and between pairs."""
    chosen = np.arange(len(data.rows))
    if len(chosen) > MAX_EPISODES:
        chosen = np.sort(rng.choice(len(chosen), MAX_EPISODES, replace=False))
    distances = episode_distances(data, chosen)
    strata, pairs = data.strata[chosen], data.pairs[chosen]
    splits = np.unique([data.rows[index].split for index in chosen], return_inverse=True)[1]
    if len(np.unique(splits)) > 1:
        name, what, labels, blocks = "energy_between_splits", "the splits of meta/info.json", splits, strata
    else:
        labels = _halves(pairs)
        name, what, blocks = "energy_between_halves", "each pair's earlier and later episodes", pairs
    return {
        name: _estimate(distances, labels, blocks, what, rng),
        "energy_between_pairs": _between_pairs(distances, pairs, data, chosen, rng),
    }


def episode_distances(data: Trajectories, chosen: np.ndarray) -> np.ndarray:
    """`(E, E)` mean distance between the frames of two episodes, an even selection of each episode's frames.

    Permutations and resamples then move whole episodes: frames of an episode are no independent draws.
    """
    each = max(2, MAX_FRAMES // max(len(chosen), 1))
    frames = np.concatenate(
        [np.linspace(data.starts[index], data.ends[index] - 1, each).round().astype(int) for index in chosen]
    )
    spec = data.task.spec
    points = np.hstack(
        [
            2 * (values[frames] - low) / (high - low) - 1
            for (low, high), values in ((spec.state.bounds, data.states), (spec.joint_action.bounds, data.actions))
        ]
    )
    result = np.empty((len(chosen), len(chosen)))
    for row in range(len(chosen)):
        block = cdist(points[row * each : (row + 1) * each], points)
        result[row] = block.reshape(each, len(chosen), each).mean(axis=(0, 2))
    return result


def energy_coefficient(distances: np.ndarray, labels: np.ndarray, weights: np.ndarray | None = None) -> float:
    """Of two groups, or the mean over all two of several by the product of their sizes.

    Args:
        distances: `(E, E)` from `episode_distances`.
        labels: `(E,)` group of each episode.
        weights: `(E,)` how often each is counted, once by default.
    """
    onehot = (labels[:, None] == np.unique(labels)).astype(float)
    if weights is not None:
        onehot *= weights[:, None]
    sizes = onehot.sum(axis=0)
    present = sizes > 0
    onehot, sizes = onehot[:, present], sizes[present]
    if len(sizes) < 2:
        return 0.0
    means = (onehot.T @ distances @ onehot) / np.outer(sizes, sizes)
    own = np.diag(means)
    energy = 2 * means - own[:, None] - own
    size = np.outer(sizes, sizes)
    upper = np.triu_indices(len(sizes), 1)
    between = (2 * means * size)[upper].sum()
    return float((energy * size)[upper].sum() / between) if between > 0 else 0.0


def _estimate(
    distances: np.ndarray, labels: np.ndarray, blocks: np.ndarray, what: str, rng: np.random.Generator
) -> Estimate:
    definition = f"{_DISTANCE} Between {what}."
    episodes = len(labels)
    if len(np.unique(labels)) < 2:
        return Estimate(None, "1", definition, episodes, note="there is only one")
    value = energy_coefficient(distances, labels)
    again = [energy_coefficient(distances, labels, _drawn(labels, rng)) for _ in range(_REPLICATES)]
    bounds = interval(value, np.array(again), 0.0, 1.0)
    within = exchangeable(labels, blocks) >= episodes / 2
    strata = blocks if within else np.zeros(episodes, dtype=int)
    draws = [energy_coefficient(distances, permuted_within(labels, strata, rng)) for _ in range(_PERMUTATIONS)]
    how = "whole episodes exchanged" + (" within each pair or configuration" if within else "")
    null = Null.from_draws(how, value, np.array(draws))
    return Estimate(value, "1", definition, episodes, bounds, "episodes of each part", null)


def _between_pairs(
    distances: np.ndarray, pairs: np.ndarray, data: Trajectories, chosen: np.ndarray, rng: np.random.Generator
) -> Estimate:
    strata = data.strata[chosen]
    estimate = _estimate(distances, pairs, strata, "pairs, the mean over each two by their episodes", rng)
    numbers = np.unique(pairs)
    if not 2 < len(numbers) <= MAX_TABLE:
        return estimate
    names = {int(pairs[place]): data.rows[index].pair_id for place, index in enumerate(chosen)}
    table = []
    for one, other in combinations(numbers, 2):
        of_two = np.isin(pairs, (one, other))
        part = _estimate(distances[np.ix_(of_two, of_two)], pairs[of_two], strata[of_two], "two pairs", rng)
        table.append({"pairs": [names[one], names[other]], "value": part.value, "p": part.null.p if part.null else 1.0})
    for entry, p in zip(table, false_discovery_control([entry["p"] for entry in table]), strict=True):
        entry["p_adjusted"] = float(p)
    estimate.details["each_two"] = table
    return estimate


def _halves(pairs: np.ndarray) -> np.ndarray:
    """0 for the earlier half of each pair's episodes, 1 for the later."""
    labels = np.zeros(len(pairs), dtype=int)
    for pair in np.unique(pairs):
        members = np.flatnonzero(pairs == pair)
        labels[members[len(members) // 2 :]] = 1
    return labels


def _drawn(labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    weights = np.zeros(len(labels))
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        weights[members] = np.bincount(rng.integers(len(members), size=len(members)), minlength=len(members))
    return weights
