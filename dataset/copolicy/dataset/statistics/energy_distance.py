"""Energy distance between parts of a data set in states and actions: splits, early and late episodes, pairs."""

from itertools import combinations

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import false_discovery_control

from ..arrays import Array
from .estimate import Estimate, Null
from .resampling import exchangeable, interval, permuted_within
from .trajectories import Trajectories

MAX_FRAMES = 4_000
MAX_EPISODES = 1_000
MAX_COMPARED_PAIRS = 12
"""Largest number of pairs of players for which every two are compared, in addition to all at once."""

_PERMUTATIONS = 499
_REPLICATES = 200
_DISTANCE = (
    "Energy coefficient (2 E|X-Y| - E|X-X'| - E|Y-Y'|) / 2 E|X-Y| of states and actions, both in the task's bounds "
    "scaled to [-1, 1]: 0 the same distribution, 1 no overlap (Szekely and Rizzo 2013). Every episode counts alike."
)


def energy_statistics(data: Trajectories, rng: np.random.Generator) -> dict[str, Estimate]:
    """Energy coefficients between splits (earlier and later episodes if there is one split) and between pairs."""
    chosen = np.arange(len(data.rows))
    if len(chosen) > MAX_EPISODES:
        chosen = np.sort(rng.choice(len(chosen), MAX_EPISODES, replace=False))
    distances = episode_distances(data, chosen)
    strata, pairs = data.strata[chosen], data.pairs[chosen]
    splits = np.unique([data.rows[index].split for index in chosen], return_inverse=True)[1]
    if len(np.unique(splits)) > 1:
        name, description, labels, blocks = "energy_between_splits", "the splits of meta/info.json", splits, strata
    else:
        labels = _earlier_later(pairs)
        name, description, blocks = "energy_between_halves", "each pair's earlier and later episodes", pairs
    return {
        name: _estimate(distances, labels, blocks, description, rng),
        "energy_between_pairs": _between_pairs(distances, pairs, data, chosen, rng),
    }


def episode_distances(data: Trajectories, chosen: Array) -> Array:
    """`(E, E)` mean distances between the frames of two episodes, for evenly spaced frames of each episode.

    Frames of an episode are not independent; with these distances permutations and resamples draw whole episodes.
    """
    per_episode = max(2, MAX_FRAMES // max(len(chosen), 1))
    frames = np.concatenate(
        [np.linspace(data.starts[index], data.ends[index] - 1, per_episode).round().astype(int) for index in chosen]
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
        block = cdist(points[row * per_episode : (row + 1) * per_episode], points)
        result[row] = block.reshape(per_episode, len(chosen), per_episode).mean(axis=(0, 2))
    return result


def energy_coefficient(distances: Array, labels: Array, weights: Array | None = None) -> float:
    """Energy coefficient of two groups; for several groups the mean over all two, weighted by their sizes' product.

    Args:
        distances: `(E, E)` from `episode_distances`.
        labels: `(E,)` group of each episode.
        weights: `(E,)` multiplicity of each episode, 1 by default.
    """
    membership = (labels[:, None] == np.unique(labels)).astype(float)
    if weights is not None:
        membership *= weights[:, None]
    sizes = membership.sum(axis=0)
    present = sizes > 0
    membership, sizes = membership[:, present], sizes[present]
    if len(sizes) < 2:
        return 0.0
    means = (membership.T @ distances @ membership) / np.outer(sizes, sizes)
    within = np.diag(means)
    energy = 2 * means - within[:, None] - within
    products = np.outer(sizes, sizes)
    upper = np.triu_indices(len(sizes), 1)
    between = (2 * means * products)[upper].sum()
    return float((energy * products)[upper].sum() / between) if between > 0 else 0.0


def _estimate(distances: Array, labels: Array, blocks: Array, description: str, rng: np.random.Generator) -> Estimate:
    definition = f"{_DISTANCE} Between {description}."
    episodes = len(labels)
    if len(np.unique(labels)) < 2:
        return Estimate(None, "1", definition, episodes, note="there is only one part")
    value = energy_coefficient(distances, labels)
    replicates = [energy_coefficient(distances, labels, _bootstrap_weights(labels, rng)) for _ in range(_REPLICATES)]
    bounds = interval(value, np.array(replicates), 0.0, 1.0)
    within = exchangeable(labels, blocks) >= episodes / 2
    strata = blocks if within else np.zeros(episodes, dtype=int)
    draws = [energy_coefficient(distances, permuted_within(labels, strata, rng)) for _ in range(_PERMUTATIONS)]
    method = "whole episodes exchanged" + (" within each pair or configuration" if within else "")
    null = Null.from_draws(method, value, np.array(draws))
    return Estimate(value, "1", definition, episodes, bounds, "episodes of each part", null)


def _between_pairs(
    distances: Array, pairs: Array, data: Trajectories, chosen: Array, rng: np.random.Generator
) -> Estimate:
    strata = data.strata[chosen]
    estimate = _estimate(distances, pairs, strata, "pairs, the mean over each two by their episodes", rng)
    numbers = np.unique(pairs)
    if not 2 < len(numbers) <= MAX_COMPARED_PAIRS:
        return estimate
    names = {int(pairs[position]): data.rows[index].pair_id for position, index in enumerate(chosen)}
    rows = []
    for first, second in combinations(numbers, 2):
        selected = np.isin(pairs, (first, second))
        estimate_two = _estimate(
            distances[np.ix_(selected, selected)], pairs[selected], strata[selected], "two pairs", rng
        )
        rows.append(
            {
                "pairs": [names[first], names[second]],
                "value": estimate_two.value,
                "p": estimate_two.null.p if estimate_two.null else 1.0,
            }
        )
    for row, p in zip(rows, false_discovery_control([row["p"] for row in rows]), strict=True):
        row["p_adjusted"] = float(p)
    estimate.details["each_two"] = rows
    return estimate


def _earlier_later(pairs: Array) -> Array:
    """0 for the earlier half of each pair's episodes, 1 for the later."""
    labels = np.zeros(len(pairs), dtype=int)
    for pair in np.unique(pairs):
        members = np.flatnonzero(pairs == pair)
        labels[members[len(members) // 2 :]] = 1
    return labels


def _bootstrap_weights(labels: Array, rng: np.random.Generator) -> Array:
    weights = np.zeros(len(labels))
    for label in np.unique(labels):
        members = np.flatnonzero(labels == label)
        weights[members] = np.bincount(rng.integers(len(members), size=len(members)), minlength=len(members))
    return weights
