"""How many different paths there are in a configuration, without asking which side of what they pass."""

import warnings
from collections import Counter

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import GaussianMixture

from .estimate import Estimate, left_out
from .trajectories import Trajectories

POINTS = 20
"""Points, evenly spaced in arc length, that stand for a path."""

MIN_EPISODES = 8
"""Successful episodes of a configuration below which its paths are not counted."""

MOST_MODES = 8
RESOLUTION = 1 / 120
"""Spread within a mode below which it is not believed, of the width of the scene: paths that differ by less, rms, are
one mode."""

_COMPONENTS = 5
_SUBSAMPLES = 10
_SUBSAMPLE_SHARE = 0.8
_REPLICATES = 1000


def resample_path(path: np.ndarray, points: int = POINTS) -> np.ndarray:
    """`(points, 2)` of a path `(T, 2)`, evenly spaced along its length."""
    along = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))
    places = np.linspace(0, along[-1], points)
    return np.column_stack([np.interp(places, along, path[:, axis]) for axis in range(2)])


def count_modes(paths: np.ndarray, seed: int, resolution: float) -> tuple[int, np.ndarray]:
    """Number of Gaussian modes with the least BIC, and the mode of each path.

    Args:
        paths: `(n, points, 2)`.
        seed: of the mixtures' starts.
        resolution: spread that a mode has at least, in the unit of the paths.
    """
    # Divided so that a distance is the root mean square one between paths.
    flat = paths.reshape(len(paths), -1) / np.sqrt(paths.shape[1])
    centred = flat - flat.mean(axis=0)
    directions = np.linalg.svd(centred, full_matrices=False)[2][: min(_COMPONENTS, len(paths) - 1)]
    scores = centred @ directions.T
    tree = linkage(scores, "ward")
    best = (np.inf, 1, np.zeros(len(paths), dtype=int))
    for modes in range(1, min(MOST_MODES, len(paths) // 3) + 1):
        mixture = _mixture_from(scores, fcluster(tree, modes, "maxclust") - 1, seed, resolution)
        with warnings.catch_warnings():
            # Fewer distinct paths than modes: that mixture loses on its BIC.
            warnings.simplefilter("ignore", ConvergenceWarning)
            label = mixture.fit_predict(scores)
            bic = float(mixture.bic(scores))
        if bic < best[0] - 1e-9:
            best = (bic, len(np.unique(label)), label)
    return best[1], best[2]


def _mixture_from(scores: np.ndarray, label: np.ndarray, seed: int, resolution: float) -> GaussianMixture:
    """A mixture that starts from clusters: from random starts, few episodes often end in a poor one."""
    clusters = [scores[label == number] for number in np.unique(label)]
    variance = np.array([cluster.var(axis=0) for cluster in clusters]) + resolution**2
    return GaussianMixture(
        len(clusters),
        covariance_type="diag",
        reg_covar=resolution**2,
        weights_init=np.array([len(cluster) for cluster in clusters]) / len(scores),
        means_init=np.array([cluster.mean(axis=0) for cluster in clusters]),
        precisions_init=1 / variance,
        init_params="random_from_data",
        random_state=seed,
    )


def path_mode_statistics(data: Trajectories, seed: int) -> dict[str, Estimate]:
    """Modes of the paths of each configuration, and their mean over configurations."""
    reason, outline = data.positions_missing, data.task.outline
    if reason or outline is None:
        return left_out(reason, "path_modes")
    resolution, succeeded = outline.size[0] * RESOLUTION, data.task.words.success
    definition = (
        f"Path modes in a configuration, averaged over configurations by their episodes: paths of the episodes that "
        f"{succeeded}, {POINTS} points even in arc length, principal components, Gaussian mixture (diagonal, "
        f"spread of at least {resolution:g} {outline.unit} rms) of 1 to {MOST_MODES} modes with the least BIC and "
        f"three episodes a mode or more. A configuration's range is that of {_SUBSAMPLES} subsamples of "
        f"{_SUBSAMPLE_SHARE:.0%}; adjusted_rand compares the modes with the route classes (1 the same)."
    )
    words = data.labels
    success = np.array([row.success for row in data.rows])
    rng = np.random.default_rng(seed)
    per_configuration: dict[str, dict] = {}
    weighted, episodes, total = np.zeros(_REPLICATES), 0, 0
    for name in np.unique(data.configurations):
        members = np.flatnonzero((data.configurations == name) & success)
        if len(members) < MIN_EPISODES:
            continue
        paths = np.array([resample_path(data.path(index)) for index in members])
        count, label = count_modes(paths, seed, resolution)
        episodes += len(members)
        total += count * len(members)
        keep = max(MIN_EPISODES - 1, round(_SUBSAMPLE_SHARE * len(members)))
        draws = [paths[rng.choice(len(paths), keep, replace=False)] for _ in range(_SUBSAMPLES)]
        again = [count_modes(drawn, seed, resolution)[0] for drawn in draws]
        weighted += rng.choice(again, _REPLICATES) * len(members)
        entry = {"episodes": len(members), "modes": count, "range": [min(again), max(again)]}
        entry["subsamples"] = dict(sorted(Counter(again).items()))
        known = [words[index] or "" for index in members]
        if any(known):
            entry["adjusted_rand"] = float(adjusted_rand_score(known, label))
        per_configuration[str(name)] = entry
    if not per_configuration:
        note = f"no configuration has {MIN_EPISODES} episodes that {succeeded}"
        return {"path_modes": Estimate(None, "modes", definition, 0, note=note)}
    value = total / episodes
    low, high = np.quantile(weighted / episodes, (0.025, 0.975))
    bounds = (min(float(low), value), max(float(high), value))
    agreement = [entry["adjusted_rand"] for entry in per_configuration.values() if "adjusted_rand" in entry]
    details = {
        "adjusted_rand_with_routes": float(np.mean(agreement)) if agreement else None,
        "configurations_used": len(per_configuration),
        "configurations": per_configuration,
    }
    how = "subsamples of each configuration"
    return {"path_modes": Estimate(value, "modes", definition, episodes, bounds, how, details=details)}
