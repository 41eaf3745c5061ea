"""Variance explained by the pair (eta squared): how much of the variation of routes and durations is between pairs."""

import numpy as np

from ..arrays import Array
from .estimate import Estimate, Null, left_out
from .resampling import Bootstrap, drawn_within, exchangeable, interval, permuted_within
from .trajectories import Trajectories

_PERMUTATIONS = 999
_ROUTE = "route_between_pair_share"


def eta_squared_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Eta squared of route and duration by pair, within configurations, and of duration by configuration."""
    labels = data.labels
    labelled = np.array([index for index, label in enumerate(labels) if label is not None], dtype=int)
    classes = sorted({label for label in labels if label is not None})
    onehot = np.array([[labels[index] == label for label in classes] for index in labelled], dtype=float)
    success = np.flatnonzero([row.success for row in data.rows])
    duration = np.array([[data.rows[index].duration_s] for index in success])
    if data.task.offers("strategy"):
        description = "route class (probability that two differ, Light and Margolin 1971)"
        route = {_ROUTE: _within_configurations(data, labelled, onehot, description, rng)}
    else:
        route = left_out(data.task.missing("strategy labels"), _ROUTE)
    return {
        **route,
        "duration_between_pair_share": _within_configurations(data, success, duration, "duration", rng),
        "duration_between_configuration_share": _by_configuration(data, success, duration, bootstrap, rng),
    }


def eta_squared(values: Array, labels: Array, strata: Array, weights: Array | None = None) -> float:
    """Proportion of the sum of squares within strata that lies between labels; NaN if the values do not vary.

    Args:
        values: `(E, n)`; a categorical variable is one-hot encoded.
        labels, strata: `(E,)`.
        weights: `(E,)` multiplicity of each episode, 1 by default.
    """
    weights = np.ones(len(values)) if weights is None else weights
    cells = strata * (int(labels.max()) + 1) + labels
    total, inside = _squares(values, strata, weights), _squares(values, cells, weights)
    return 1 - inside / total if total > 1e-12 else float("nan")


def _squares(values: Array, groups: Array, weights: Array) -> float:
    count = np.maximum(np.bincount(groups, weights), 1e-12)
    total = 0.0
    for column in values.T:
        mean = np.bincount(groups, weights * column) / count
        total += float((weights * (column - mean[groups]) ** 2).sum())
    return total


def _within_configurations(
    data: Trajectories, episodes: Array, values: Array, description: str, rng: np.random.Generator
) -> Estimate:
    definition = (
        f"Eta squared: the proportion of the variation of {description} within configurations that lies between pairs, "
        f"of episodes that {data.task.words.success}. With few episodes per pair and configuration it is biased "
        "upward: compare it with its null distribution."
    )
    pairs, strata = data.pairs[episodes], data.strata[episodes]
    exchangeable_episodes = exchangeable(pairs, strata) if len(episodes) else 0
    if not exchangeable_episodes:
        note = "no configuration has episodes of two pairs"
        return Estimate(None, "1", definition, len(episodes), note=note)
    value = eta_squared(values, pairs, strata)
    if not np.isfinite(value):
        return Estimate(None, "1", definition, len(episodes), note="nothing varies within a configuration")
    cells = np.unique(np.column_stack((strata, pairs)), axis=0, return_inverse=True)[1].ravel()
    replicates = np.array([eta_squared(values, pairs, strata, drawn_within(cells, rng)) for _ in range(_PERMUTATIONS)])
    bounds = interval(value, replicates[np.isfinite(replicates)], 0.0, 1.0)
    draws = np.array([eta_squared(values, permuted_within(pairs, strata, rng), strata) for _ in range(_PERMUTATIONS)])
    null = Null.from_draws("pairs shuffled among the episodes of each configuration", value, draws)
    # Adjusted for the expectation under the null, as the adjusted R squared is.
    details = {"adjusted": (value - null.mean) / (1 - null.mean) if null.mean < 1 else None}
    return Estimate(
        value, "1", definition, len(episodes), bounds, "episodes of each pair and configuration", null, details=details
    )


def _by_configuration(
    data: Trajectories, episodes: Array, values: Array, bootstrap: Bootstrap, rng: np.random.Generator
) -> Estimate:
    definition = (
        "Eta squared: the proportion of the variation of duration that lies between configurations, of episodes that "
        f"{data.task.words.success}."
    )
    strata = data.strata[episodes]
    single_stratum = np.zeros(len(episodes), dtype=int)
    value = eta_squared(values, strata, single_stratum) if len(episodes) else float("nan")
    if len(np.unique(strata)) < 2 or not np.isfinite(value):
        return Estimate(None, "1", definition, len(episodes), note="one configuration, or nothing varies")
    if len(np.unique(strata)) == len(strata):  # then the proportion is 1, whatever the durations are
        return Estimate(None, "1", definition, len(episodes), note="no configuration has two episodes")
    weights = bootstrap.weights[:_PERMUTATIONS, episodes].astype(float)
    replicates = np.array([eta_squared(values, strata, single_stratum, row) for row in weights])
    draws = np.array([eta_squared(values, rng.permutation(strata), single_stratum) for _ in range(_PERMUTATIONS)])
    bounds = interval(value, replicates[np.isfinite(replicates)], 0.0, 1.0)
    null = Null.from_draws("configurations shuffled among episodes", value, draws)
    return Estimate(value, "1", definition, len(episodes), bounds, bootstrap.resampled, null)
