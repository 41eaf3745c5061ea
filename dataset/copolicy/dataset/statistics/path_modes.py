"""Number of path modes in a configuration, by clustering of paths, independent of strategy labels."""

import warnings
from collections import Counter

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from sklearn.exceptions import ConvergenceWarning
from sklearn.metrics import adjusted_rand_score
from sklearn.mixture import GaussianMixture

from ..arrays import Array
from .estimate import Estimate, left_out
from .trajectories import Trajectories

POINTS = 20
"""Number of points, evenly spaced in arc length, that represent a path."""

MIN_EPISODES = 8
"""Smallest number of successful episodes for which the modes of a configuration are counted."""

MAX_MODES = 8
RESOLUTION = 1 / 120
"""Smallest spread within a mode (rms), relative to the width of the scene: paths that differ by less are one mode."""

_COMPONENTS = 5
_SUBSAMPLES = 10
_SUBSAMPLE_FRACTION = 0.8
_REPLICATES = 1000


def resample_path(path: Array, points: int = POINTS) -> Array:
    """`(points, 2)` points of a path `(T, 2)`, evenly spaced in arc length."""
    arc_length = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))
    positions = np.linspace(0, arc_length[-1], points)
    return np.column_stack([np.interp(positions, arc_length, path[:, axis]) for axis in range(2)])


def count_modes(paths: Array, seed: int, resolution: float) -> tuple[int, Array]:
    """Number of modes of the Gaussian mixture with the lowest BIC, and the mode of each path.

    Args:
        paths: `(n, points, 2)`.
        seed: seed of the mixture fits.
        resolution: smallest spread of a mode, in the unit of the paths.
    """
    # Scaled so that the Euclidean distance is the root mean square distance between paths.
    flat = paths.reshape(len(paths), -1) / np.sqrt(paths.shape[1])
    centred = flat - flat.mean(axis=0)
    directions = np.linalg.svd(centred, full_matrices=False)[2][: min(_COMPONENTS, len(paths) - 1)]
    scores = centred @ directions.T
    tree = linkage(scores, "ward")
    best = (np.inf, 1, np.zeros(len(paths), dtype=int))
    for modes in range(1, min(MAX_MODES, len(paths) // 3) + 1):
        mixture = _mixture_from(scores, fcluster(tree, modes, "maxclust") - 1, seed, resolution)
        with warnings.catch_warnings():
            # With fewer distinct paths than modes the fit does not converge, but its BIC is not the lowest.
            warnings.simplefilter("ignore", ConvergenceWarning)
            label = mixture.fit_predict(scores)
            bic = float(mixture.bic(scores))
        if bic < best[0] - 1e-9:
            best = (bic, len(np.unique(label)), label)
    return best[1], best[2]


def _mixture_from(scores: Array, label: Array, seed: int, resolution: float) -> GaussianMixture:
    """A mixture initialised from clusters: with few episodes, random starts often end in a poor fit."""
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
    """Number of path modes of each configuration, and its mean over configurations."""
    reason, outline = data.positions_missing, data.task.outline
    if reason or outline is None:
        return left_out(reason, "path_modes")
    resolution, succeeded = outline.size[0] * RESOLUTION, data.task.words.success
    definition = (
        f"Path modes in a configuration, averaged over configurations by their episodes: paths of the episodes that "
        f"{succeeded}, {POINTS} points evenly spaced in arc length, principal components, Gaussian mixture (diagonal, "
        f"spread of at least {resolution:g} {outline.unit} rms) of 1 to {MAX_MODES} modes with the lowest BIC and at "
        f"least three episodes per mode. The range of a configuration is over {_SUBSAMPLES} subsamples of "
        f"{_SUBSAMPLE_FRACTION:.0%}; adjusted_rand compares the modes with the route classes (1: identical)."
    )
    labels = data.labels
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
        subsample_size = max(MIN_EPISODES - 1, round(_SUBSAMPLE_FRACTION * len(members)))
        draws = [paths[rng.choice(len(paths), subsample_size, replace=False)] for _ in range(_SUBSAMPLES)]
        subsample_modes = [count_modes(subsample, seed, resolution)[0] for subsample in draws]
        weighted += rng.choice(subsample_modes, _REPLICATES) * len(members)
        entry = {"episodes": len(members), "modes": count, "range": [min(subsample_modes), max(subsample_modes)]}
        entry["subsamples"] = dict(sorted(Counter(subsample_modes).items()))
        route_labels = [labels[index] or "" for index in members]
        if any(route_labels):
            entry["adjusted_rand"] = float(adjusted_rand_score(route_labels, label))
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
    method = "subsamples of each configuration"
    return {"path_modes": Estimate(value, "modes", definition, episodes, bounds, method, details=details)}
