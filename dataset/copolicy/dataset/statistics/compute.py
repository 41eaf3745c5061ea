"""All statistics of a data set as one document, the content of `meta/copolicy_stats.json`."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..command_line.commands import progress
from ..episode import Source
from .action_variance import variance_statistics
from .energy_distance import energy_statistics
from .estimate import rounded
from .forces import activity_statistics, force_statistics
from .leadership import leadership_statistics
from .path_modes import path_mode_statistics
from .reading import read_trajectories
from .resampling import MIN_CLUSTERS, Bootstrap
from .route_entropy import route_statistics
from .smoothness import smoothness_statistics
from .trajectories import Trajectories
from .variance_explained import eta_squared_statistics
from .visitation import visitation_statistics

DEFINITION_VERSION = "2.0.0"
"""Version of the definitions: major if the computation of a value changes, minor if a statistic is added."""

REPLICATES = 1000
_SOURCE_LABELS = {
    "simulated": "scripted pairs, no person took part",
    "upstream": "files of the original program, which do not say who held the sticks",
}


def dataset_statistics(path: Path | str, source: Source | None = None, seed: int = 0) -> dict[str, Any]:
    """Computes the statistics of a LeRobot v3 folder: the document that `copolicy-dataset stats` writes.

    Args:
        source: use only episodes of this source.

    Raises:
        FileFormatError: the folder does not exist, or is not a data set of an installed task.
    """
    data, left_out = read_trajectories(Path(path), source)
    return compute_statistics(data, seed, left_out)


def compute_statistics(
    data: Trajectories, seed: int = 0, left_out: Mapping[str, int] | None = None, replicates: int = REPLICATES
) -> dict[str, Any]:
    """Computes all statistics as a document: definition version, settings, data set, and the statistics by family.

    Deterministic for equal data and seed: each family has its own random generator.

    Args:
        left_out: number of omitted episodes, by reason.
        replicates: number of bootstrap replicates.
    """
    bootstrap = Bootstrap(data.pairs, replicates, np.random.default_rng((seed, 0)))
    families = {
        "routes": lambda rng: route_statistics(data, bootstrap, rng),
        "paths": lambda rng: path_mode_statistics(data, seed),
        "actions": lambda rng: variance_statistics(data, bootstrap, rng),
        "visitation": lambda rng: visitation_statistics(data, bootstrap, rng),
        "leadership": lambda rng: leadership_statistics(data, bootstrap, rng),
        "forces": lambda rng: force_statistics(data, bootstrap, rng),
        "activity": lambda rng: activity_statistics(data, bootstrap),
        "smoothness": lambda rng: smoothness_statistics(data, bootstrap),
        "distances": lambda rng: energy_statistics(data, rng),
        "pairs": lambda rng: eta_squared_statistics(data, bootstrap, rng),
    }
    of_task = data.task.statistics
    families |= {name: lambda rng: {} for name in of_task.families if name not in families}
    statistics = {}
    for index, (family, compute) in enumerate(progress(families.items(), len(families), "statistics"), start=1):
        rng = np.random.default_rng((seed, index))
        estimates = compute(rng)
        if family in of_task.families:
            estimates |= of_task.families[family](data, bootstrap, rng)
        statistics[family] = {name: estimate.as_dict() for name, estimate in estimates.items()}
    labels = {**_SOURCE_LABELS, "human": of_task.people}
    sources = Counter(row.source for row in data.rows)
    document = {
        "definition_version": DEFINITION_VERSION,
        "settings": {
            "seed": seed,
            "bootstrap_replicates": replicates,
            "bootstrap_unit": bootstrap.resampled,
            "pairs_needed_to_draw_pairs": MIN_CLUSTERS,
            "confidence": 0.95,
        },
        "dataset": {
            "episodes": len(data.rows),
            "frames": len(data.states),
            "fps": data.fps,
            "pairs": len(np.unique(data.pairs)),
            "configurations": len(np.unique(data.strata)),
            "successes": sum(row.success for row in data.rows),
            "left_out": dict(left_out or {}),
            "sources": dict(sorted(sources.items())),
            "source_labels": {name: labels.get(name, "unknown") for name in sorted(sources)},
        },
        **({"human_reference": of_task.reference(np.random.default_rng((seed, 11)))} if of_task.reference else {}),
        "statistics": statistics,
    }
    return rounded(document)
