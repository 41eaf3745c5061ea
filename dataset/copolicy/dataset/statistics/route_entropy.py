"""Entropy of strategy labels in each configuration; for the table task the label is the route around the obstacles."""

import math
from collections import Counter
from typing import Any

import numpy as np

from .entropy import entropy, miller_madow, simpson
from .estimate import Estimate, left_out
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

MIN_EPISODES = 5
"""Smallest number of episodes for which the entropy of a configuration is computed."""


def route_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Number of labelled episodes, and the entropy of the labels given the configuration."""
    if not data.task.offers("strategy"):
        return left_out(data.task.missing("strategy labels"), "route_class", "route_entropy")
    labels = decided_labels(data)
    return {
        "route_class": route_class_count(data, labels, f"Episodes with a strategy label. {success_condition(data)}"),
        "route_entropy": _conditional_entropy(data, labels, bootstrap, rng),
    }


def success_condition(data: Trajectories) -> str:
    """Sentence for definitions: which episodes have labels."""
    words = data.task.words
    return f"Of episodes that {words.success}: the {words.label} of an unfinished one is not decided."


def decided_labels(data: Trajectories) -> dict[int, str]:
    """The strategy label of each labelled episode, by episode index."""
    return {index: label for index, label in enumerate(data.labels) if label is not None}


def route_class_count(data: Trajectories, labels: dict[int, str], definition: str) -> Estimate:
    """Number of labelled episodes, and how many labels differ from the column `route_class`."""
    different = sum(data.rows[index].route_class not in ("", label) for index, label in labels.items())
    details = {"episodes_without": len(data.rows) - len(labels), "unlike_the_episode_column": different}
    return Estimate(len(labels), "episodes", definition, len(labels), details=details)


def label_entropy(
    counts: Counter[str], obstacles: int | None, rng: np.random.Generator, replicates: int = 1000
) -> dict[str, Any]:
    """Entropy and related measures of the label counts of one group of episodes.

    Args:
        obstacles: maximum entropy, one bit per obstacle; None if unknown.

    Returns:
        `episodes`, `counts`, `entropy_bits` (Miller-Madow, at most `obstacles`), its bootstrap `interval` over
        episodes, `plug_in_bits`, `effective_modes` 2^H with interval, `normalised` by `obstacles`, and `simpson`, the
        probability that two episodes differ. `entropy_bits` is None below `MIN_EPISODES`.
    """
    numbers = np.array([number for _, number in sorted(counts.items())])
    total = int(numbers.sum())
    max_bits, max_entry = (math.inf, {}) if obstacles is None else (float(obstacles), {"obstacles": obstacles})
    result: dict[str, Any] = {"episodes": total, **max_entry, "counts": dict(counts.most_common())}
    if total < MIN_EPISODES:
        return result | {"entropy_bits": None, "note": f"fewer than {MIN_EPISODES} episodes"}
    plug_in, value = float(entropy(numbers)), min(float(miller_madow(numbers)), max_bits)
    if len(numbers) == 1:
        # All resamples have one label. The bound is the largest proportion of an unobserved label at p = 0.05.
        unseen = 1 - 0.05 ** (1 / total)
        bounds = (0.0, float(entropy(np.array([unseen, 1 - unseen]))))
    else:
        draws = rng.multinomial(total, numbers / total, size=replicates)
        bounds = interval(value, np.minimum(miller_madow(draws), max_bits), 0.0, max_bits)
    return result | {
        "entropy_bits": value,
        "interval": bounds,
        "plug_in_bits": plug_in,
        "effective_modes": 2**value,
        "effective_modes_interval": [2**bound for bound in bounds],
        **({} if obstacles is None else {"normalised": value / obstacles}),
        "simpson": float(simpson(numbers)),
    }


def _conditional_entropy(
    data: Trajectories, labels: dict[int, str], bootstrap: Bootstrap, rng: np.random.Generator
) -> Estimate:
    definition = (
        "H(route | configuration): the entropy of the route classes in each configuration (start, goal, obstacles), "
        "Miller-Madow, averaged over configurations by their episodes. The interval of a configuration resamples its "
        f"episodes. {success_condition(data)}"
    )
    names = sorted({str(data.configurations[index]) for index in labels})
    cells = sorted({(str(data.configurations[index]), labels[index]) for index in labels})
    column = {cell: index for index, cell in enumerate(cells)}
    onehot = np.zeros((len(data.rows), len(cells)), dtype=np.float32)
    for index in labels:
        onehot[index, column[str(data.configurations[index]), labels[index]]] = 1
    per_configuration, used = {}, []
    bits = data.task.statistics.label_bits
    for name in names:
        counts = Counter(labels[index] for index in labels if data.configurations[index] == name)
        entry = label_entropy(counts, bits(next(iter(counts))) if bits else None, rng)
        per_configuration[name] = entry
        if entry["entropy_bits"] is not None:
            used.append(name)
    details = {"configurations": per_configuration}
    if not used:
        note = f"no configuration has {MIN_EPISODES} episodes with a route"
        return Estimate(None, "bits", definition, 0, note=note, details=details)
    replicates = bootstrap.weights @ onehot
    weighted, totals = np.zeros(len(replicates)), np.zeros(len(replicates))
    for name in used:
        counts = replicates[:, [index for index, cell in enumerate(cells) if cell[0] == name]]
        entropies = np.minimum(miller_madow(counts), per_configuration[name].get("obstacles", math.inf))
        weighted += entropies * counts.sum(axis=1)
        totals += counts.sum(axis=1)
    episodes = sum(per_configuration[name]["episodes"] for name in used)
    value = sum(per_configuration[name]["entropy_bits"] * per_configuration[name]["episodes"] for name in used)
    value /= episodes
    bounds = interval(value, weighted[totals > 0] / totals[totals > 0], 0.0)
    mean_simpson = sum(per_configuration[name]["simpson"] * per_configuration[name]["episodes"] for name in used)
    details = {
        "effective_modes": 2**value,
        "simpson": mean_simpson / episodes,
        "configurations_used": len(used),
        "configurations_too_small": len(names) - len(used),
        **details,
    }
    return Estimate(value, "bits", definition, episodes, bounds, bootstrap.resampled, details=details)
