"""Whether "multimodality" is just who carried: the share of routes and durations that the pair explains."""

import numpy as np

from .estimate import Estimate, Null, left_out
from .resampling import Bootstrap, drawn_within, exchangeable, interval, permuted_within
from .trajectories import Trajectories

_PERMUTATIONS = 999
_ROUTE = "route_between_pair_share"


def eta_squared_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Eta squared of route and duration by pair within configurations, and of duration by configuration."""
    words = data.labels
    decided = np.array([index for index, word in enumerate(words) if word is not None], dtype=int)
    vocabulary = sorted({word for word in words if word is not None})
    onehot = np.array([[words[index] == word for word in vocabulary] for index in decided], dtype=float)
    success = np.flatnonzero([row.success for row in data.rows])
    duration = np.array([[data.rows[index].duration_s] for index in success])
    if data.task.offers("strategy"):
        what = "route class (chance that two differ, Light and Margolin 1971)"
        route = {_ROUTE: _within_configurations(data, decided, onehot, what, rng)}
    else:
        route = left_out(data.task.missing("strategy labels"), _ROUTE)
    return {
        **route,
        "duration_between_pair_share": _within_configurations(data, success, duration, "duration", rng),
        "duration_between_configuration_share": _by_configuration(data, success, duration, bootstrap, rng),
    }


def explained(values: np.ndarray, labels: np.ndarray, strata: np.ndarray, weights: np.ndarray | None = None) -> float:
    """Share of the sum of squares within strata that lies between the labels in them; nan where nothing varies.

    Args:
        values: `(E, n)`; of a class, one column each with 0 and 1.
        labels, strata: `(E,)`.
        weights: `(E,)` how often each is counted, once by default.
    """
    weights = np.ones(len(values)) if weights is None else weights
    cells = strata * (int(labels.max()) + 1) + labels
    total, inside = _squares(values, strata, weights), _squares(values, cells, weights)
    return 1 - inside / total if total > 1e-12 else float("nan")


def _squares(values: np.ndarray, groups: np.ndarray, weights: np.ndarray) -> float:
    count = np.maximum(np.bincount(groups, weights), 1e-12)
    result = 0.0
    for column in values.T:
        mean = np.bincount(groups, weights * column) / count
        result += float((weights * (column - mean[groups]) ** 2).sum())
    return result


def _within_configurations(
    data: Trajectories, chosen: np.ndarray, values: np.ndarray, what: str, rng: np.random.Generator
) -> Estimate:
    definition = (
        f"Eta squared: the share of the variation of {what} within configurations that lies between the pairs in "
        f"each, of episodes that {data.task.words.success}. With few episodes a pair and configuration it is large by "
        "chance: hold it against its null."
    )
    pairs, strata = data.pairs[chosen], data.strata[chosen]
    movable = exchangeable(pairs, strata) if len(chosen) else 0
    if not movable:
        note = "no configuration was carried by two pairs"
        return Estimate(None, "1", definition, len(chosen), note=note)
    value = explained(values, pairs, strata)
    if not np.isfinite(value):
        return Estimate(None, "1", definition, len(chosen), note="nothing varies within a configuration")
    cells = np.unique(np.column_stack((strata, pairs)), axis=0, return_inverse=True)[1].ravel()
    again = np.array([explained(values, pairs, strata, drawn_within(cells, rng)) for _ in range(_PERMUTATIONS)])
    bounds = interval(value, again[np.isfinite(again)], 0.0, 1.0)
    draws = np.array([explained(values, permuted_within(pairs, strata, rng), strata) for _ in range(_PERMUTATIONS)])
    null = Null.from_draws("pairs shuffled among the episodes of each configuration", value, draws)
    # As much as chance alone explains is taken off, and off the whole.
    details = {"adjusted": (value - null.mean) / (1 - null.mean) if null.mean < 1 else None}
    return Estimate(
        value, "1", definition, len(chosen), bounds, "episodes of each pair and configuration", null, details=details
    )


def _by_configuration(
    data: Trajectories, chosen: np.ndarray, values: np.ndarray, bootstrap: Bootstrap, rng: np.random.Generator
) -> Estimate:
    definition = (
        "Eta squared: the share of the variation of duration that lies between configurations, of episodes that "
        f"{data.task.words.success}."
    )
    strata = data.strata[chosen]
    one = np.zeros(len(chosen), dtype=int)
    value = explained(values, strata, one) if len(chosen) else float("nan")
    if len(np.unique(strata)) < 2 or not np.isfinite(value):
        return Estimate(None, "1", definition, len(chosen), note="one configuration, or nothing varies")
    weights = bootstrap.weights[:_PERMUTATIONS, chosen].astype(float)
    again = np.array([explained(values, strata, one, row) for row in weights])
    draws = np.array([explained(values, rng.permutation(strata), one) for _ in range(_PERMUTATIONS)])
    return Estimate(
        value,
        "1",
        definition,
        len(chosen),
        interval(value, again[np.isfinite(again)], 0.0, 1.0),
        bootstrap.resampled,
        Null.from_draws("configurations shuffled among episodes", value, draws),
    )
