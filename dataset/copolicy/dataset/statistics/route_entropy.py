"""Strategy labels of episodes, of the table the way around the obstacles, and how evenly a configuration has them."""

import math
from collections import Counter
from typing import Any

import numpy as np

from .entropy import entropy, miller_madow, simpson
from .estimate import Estimate, left_out
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

MIN_EPISODES = 5
"""Episodes of a configuration below which its entropy is not given: counts alone."""


def route_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Strategy labels, and their entropy per configuration."""
    if not data.task.offers("strategy"):
        return left_out(data.task.missing("strategy labels"), "route_class", "route_entropy")
    taken = decided_labels(data)
    return {
        "route_class": route_class_count(data, taken, f"Episodes with a strategy label. {success_condition(data)}"),
        "route_entropy": _conditional_entropy(data, taken, bootstrap, rng),
    }


def success_condition(data: Trajectories) -> str:
    """The sentence of a definition that says which episodes have labels."""
    words = data.task.words
    return f"Of episodes that {words.success}: the {words.label} of an unfinished one is not decided."


def decided_labels(data: Trajectories) -> dict[int, str]:
    """The strategy label of each episode that has one, by the episode."""
    return {index: word for index, word in enumerate(data.labels) if word is not None}


def route_class_count(data: Trajectories, taken: dict[int, str], definition: str) -> Estimate:
    """How many episodes have a label, and how many of them another one than the column `route_class` says."""
    unlike = sum(data.rows[index].route_class not in ("", word) for index, word in taken.items())
    details = {"episodes_without": len(data.rows) - len(taken), "unlike_the_episode_column": unlike}
    return Estimate(len(taken), "episodes", definition, len(taken), details=details)


def label_entropy(
    counts: Counter[str], obstacles: int | None, rng: np.random.Generator, replicates: int = 1000
) -> dict[str, Any]:
    """Entropy and its relatives of the words of one group of episodes.

    Args:
        obstacles: bits that a word can tell at most; None where nobody knows.

    Returns:
        `episodes`, `counts`, `entropy_bits` (Miller-Madow, at most one bit an obstacle), its `interval` over episodes
        drawn anew, `plug_in_bits`, `effective_modes` 2^H with interval, `normalised` by the bits of all words, and
        `simpson`, the chance that two episodes differ; without entropy below `MIN_EPISODES`.
    """
    numbers = np.array([number for _, number in sorted(counts.items())])
    total = int(numbers.sum())
    most, of_most = (math.inf, {}) if obstacles is None else (float(obstacles), {"obstacles": obstacles})
    result: dict[str, Any] = {"episodes": total, **of_most, "counts": dict(counts.most_common())}
    if total < MIN_EPISODES:
        return result | {"entropy_bits": None, "note": f"fewer than {MIN_EPISODES} episodes"}
    plug_in, value = float(entropy(numbers)), min(float(miller_madow(numbers)), most)
    if len(numbers) == 1:
        # A resample of one word holds one word: the bound is the largest share, p = 0.05, that another could have.
        hidden = 1 - 0.05 ** (1 / total)
        bounds = (0.0, float(entropy(np.array([hidden, 1 - hidden]))))
    else:
        draws = rng.multinomial(total, numbers / total, size=replicates)
        bounds = interval(value, np.minimum(miller_madow(draws), most), 0.0, most)
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
    data: Trajectories, taken: dict[int, str], bootstrap: Bootstrap, rng: np.random.Generator
) -> Estimate:
    definition = (
        "H(route | configuration): the entropy of the route classes in each configuration (start, goal, obstacles), "
        "Miller-Madow, averaged over configurations by their episodes. Each configuration's own interval draws its "
        f"episodes anew. {success_condition(data)}"
    )
    names = sorted({str(data.configurations[index]) for index in taken})
    cells = sorted({(str(data.configurations[index]), taken[index]) for index in taken})
    column = {cell: place for place, cell in enumerate(cells)}
    onehot = np.zeros((len(data.rows), len(cells)), dtype=np.float32)
    for index in taken:
        onehot[index, column[str(data.configurations[index]), taken[index]]] = 1
    per_configuration, enough = {}, []
    bits = data.task.statistics.label_bits
    for name in names:
        counts = Counter(taken[index] for index in taken if data.configurations[index] == name)
        entry = label_entropy(counts, bits(next(iter(counts))) if bits else None, rng)
        per_configuration[name] = entry
        if entry["entropy_bits"] is not None:
            enough.append(name)
    details = {"configurations": per_configuration}
    if not enough:
        note = f"no configuration has {MIN_EPISODES} episodes with a route"
        return Estimate(None, "bits", definition, 0, note=note, details=details)
    replicates = bootstrap.weights @ onehot
    weighted, totals = np.zeros(len(replicates)), np.zeros(len(replicates))
    for name in enough:
        counts = replicates[:, [place for place, cell in enumerate(cells) if cell[0] == name]]
        entropies = np.minimum(miller_madow(counts), per_configuration[name].get("obstacles", math.inf))
        weighted += entropies * counts.sum(axis=1)
        totals += counts.sum(axis=1)
    episodes = sum(per_configuration[name]["episodes"] for name in enough)
    value = sum(per_configuration[name]["entropy_bits"] * per_configuration[name]["episodes"] for name in enough)
    value /= episodes
    bounds = interval(value, weighted[totals > 0] / totals[totals > 0], 0.0)
    mean_simpson = sum(per_configuration[name]["simpson"] * per_configuration[name]["episodes"] for name in enough)
    details = {
        "effective_modes": 2**value,
        "simpson": mean_simpson / episodes,
        "configurations_used": len(enough),
        "configurations_too_small": len(names) - len(enough),
        **details,
    }
    return Estimate(value, "bits", definition, episodes, bounds, bootstrap.resampled, details=details)
