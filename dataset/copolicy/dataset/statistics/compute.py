"""All statistics of a data set as one document, the content of `meta/copolicy_stats.json`."""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..command_line.commands import progress
from .energy_distance import energy_statistics
from .estimate import rounded
from .forces import activity_statistics, force_statistics
from .human_routes import human_distance, human_route_entropy
from .leadership import leadership_statistics
from .neighbours import neighbour_statistics
from .pair_share import pair_share_statistics
from .path_modes import path_mode_statistics
from .resampling import MIN_CLUSTERS, Bootstrap
from .route_entropy import route_statistics
from .smoothness import smoothness_statistics
from .steering_dip import dip_statistics
from .trajectories import Trajectories
from .visitation import visitation_statistics

DEFINITION_VERSION = "2.0.0"
"""Of the statistics' definitions: major where a value is computed otherwise, minor where one is added."""

REPLICATES = 1000
_LABELS = {
    "human": "people carried the table",
    "simulated": "scripted pairs, no person took part",
    "upstream": "files of the original program, which do not say who held the sticks",
}


def compute_statistics(
    data: Trajectories, seed: int = 0, left_out: Mapping[str, int] | None = None, replicates: int = REPLICATES
) -> dict[str, Any]:
    """The document: definition version, settings, seed, what was described, and the statistics by family.

    The same data and seed give the same document: each family draws from a generator of its own.

    Args:
        left_out: episodes that were not described, by reason.
        replicates: of the bootstrap.
    """
    bootstrap = Bootstrap(data.pairs, replicates, np.random.default_rng((seed, 0)))
    families = {
        "routes": lambda rng: route_statistics(data, bootstrap, rng) | human_distance(data, rng),
        "paths": lambda rng: path_mode_statistics(data, seed),
        "actions": lambda rng: neighbour_statistics(data, bootstrap, rng) | dip_statistics(data, bootstrap, rng),
        "visitation": lambda rng: visitation_statistics(data, bootstrap, rng),
        "leadership": lambda rng: leadership_statistics(data, bootstrap, rng),
        "forces": lambda rng: force_statistics(data, bootstrap, rng),
        "activity": lambda rng: activity_statistics(data, bootstrap),
        "smoothness": lambda rng: smoothness_statistics(data, bootstrap),
        "distances": lambda rng: energy_statistics(data, rng),
        "pairs": lambda rng: pair_share_statistics(data, bootstrap, rng),
    }
    statistics = {}
    for number, (family, compute) in enumerate(progress(families.items(), len(families), "statistics"), start=1):
        estimates = compute(np.random.default_rng((seed, number)))
        statistics[family] = {name: estimate.as_dict() for name, estimate in estimates.items()}
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
            "source_labels": {name: _LABELS.get(name, "unknown") for name in sorted(sources)},
        },
        "human_reference": {
            "source": "Yang and Mavrogiannis, HRI 2025: passing sides of 330 human-human demonstrations; "
            "labels, not trajectories (BSD-3-Clause)",
            "routes": human_route_entropy(np.random.default_rng((seed, len(families) + 1))),
        },
        "statistics": statistics,
    }
    return rounded(document)
