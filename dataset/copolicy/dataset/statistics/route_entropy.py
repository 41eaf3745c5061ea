"""Which way around the obstacles: route classes, and how evenly they are taken in a configuration."""

from collections import Counter

import numpy as np
from scipy.stats import binomtest

from copolicy.tasks.table.routes import route_class, winding

from .entropy import entropy, miller_madow, simpson
from .estimate import Estimate
from .resampling import Bootstrap, interval
from .trajectories import Trajectories

MIN_EPISODES = 5
"""Episodes of a configuration below which its entropy is not given: counts alone."""

CLEAR_WINDING = 0.1
"""Turns around an obstacle below which the side is called unclear."""

_PASSED = "episodes that reached the goal: the route of an unfinished one is not decided"


def routes_taken(data: Trajectories) -> list[str | None]:
    """The side word of each episode, recomputed from its frames; None without success or without obstacles."""
    return [
        route_class(data.path(index), row.map_config) if row.success and row.map_config.obstacles else None
        for index, row in enumerate(data.rows)
    ]


def route_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Route classes, per configuration and over configurations."""
    words = routes_taken(data)
    used = np.array([index for index, word in enumerate(words) if word is not None], dtype=int)
    taken = {index: word for index, word in enumerate(words) if word is not None}
    estimates = {
        "route_class": _route_class(data, taken),
        "route_entropy": _conditional_entropy(data, taken, used, bootstrap, rng),
        "route_entropy_pooled": _pooled_entropy(data, taken, rng),
    }
    return estimates


def word_entropy(counts: Counter[str], obstacles: int, rng: np.random.Generator, replicates: int = 1000) -> dict:
    """Entropy and its relatives of the words of one group of episodes.

    Returns:
        `episodes`, `counts`, `entropy_bits` (Miller-Madow, at most one bit an obstacle), its `interval` over episodes
        drawn anew, `plug_in_bits`, `effective_modes` 2^H with interval, `normalised` by the bits of all words, and
        `simpson`, the chance that two episodes differ; without entropy below `MIN_EPISODES`.
    """
    numbers = np.array([number for _, number in sorted(counts.items())])
    total = int(numbers.sum())
    result: dict = {"episodes": total, "obstacles": obstacles, "counts": dict(counts.most_common())}
    if total < MIN_EPISODES:
        return result | {"entropy_bits": None, "note": f"fewer than {MIN_EPISODES} episodes"}
    plug_in, value = float(entropy(numbers)), min(float(miller_madow(numbers)), float(obstacles))
    if len(numbers) == 1:
        # A resample of one word holds one word: the bound is the largest share, p = 0.05, that another could have.
        hidden = 1 - 0.05 ** (1 / total)
        bounds = (0.0, float(entropy(np.array([hidden, 1 - hidden]))))
    else:
        draws = rng.multinomial(total, numbers / total, size=replicates)
        bounds = interval(value, np.minimum(miller_madow(draws), obstacles), 0.0, float(obstacles))
    return result | {
        "entropy_bits": value,
        "interval": bounds,
        "plug_in_bits": plug_in,
        "effective_modes": 2**value,
        "effective_modes_interval": [2**bound for bound in bounds],
        "normalised": value / obstacles,
        "simpson": float(simpson(numbers)),
    }


def _route_class(data: Trajectories, taken: dict[int, str]) -> Estimate:
    sides: dict[str, dict] = {}
    unclear = disagree = 0
    for index, word in taken.items():
        row = data.rows[index]
        path = data.path(index)
        unclear += any(abs(winding(path, centre)) < CLEAR_WINDING for centre in row.map_config.obstacles)
        disagree += bool(row.route_class) and row.route_class != word
        entry = sides.setdefault(str(data.configurations[index]), {"episodes": 0, "left": [0] * len(word)})
        entry["episodes"] += 1
        entry["left"] = [left + (letter == "L") for left, letter in zip(entry["left"], word, strict=True)]
    for entry in sides.values():
        entry["left_interval"] = [
            binomtest(left, entry["episodes"]).proportion_ci(method="wilson") for left in entry["left"]
        ]
    return Estimate(
        len(taken),
        "episodes",
        "Episodes with a route class: for each obstacle the sign of the winding of the table's path around it, L below "
        "it on screen when carried to the right, R above; letters by atan2(y, x) of the obstacles. Of " + _PASSED + ".",
        len(taken),
        details={
            "episodes_without": len(data.rows) - len(taken),
            "unclear_side": unclear,
            "unlike_the_episode_column": disagree,
            "left_by_obstacle": dict(sorted(sides.items())),
        },
    )


def _conditional_entropy(
    data: Trajectories, taken: dict[int, str], used: np.ndarray, bootstrap: Bootstrap, rng: np.random.Generator
) -> Estimate:
    definition = (
        "H(route | configuration): the entropy of the route classes in each configuration (start, goal, obstacles), "
        "Miller-Madow, averaged over configurations by their episodes. Each configuration's own interval draws its "
        "episodes anew. Of " + _PASSED + "."
    )
    names = sorted({str(data.configurations[index]) for index in used})
    cells = sorted({(str(data.configurations[index]), taken[index]) for index in used})
    column = {cell: place for place, cell in enumerate(cells)}
    onehot = np.zeros((len(data.rows), len(cells)), dtype=np.float32)
    for index in used:
        onehot[index, column[str(data.configurations[index]), taken[index]]] = 1
    per_configuration, enough = {}, []
    for name in names:
        counts = Counter(taken[index] for index in used if data.configurations[index] == name)
        entry = word_entropy(counts, len(next(iter(counts))), rng)
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
        bits = np.minimum(miller_madow(counts), per_configuration[name]["obstacles"])
        weighted += bits * counts.sum(axis=1)
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


def _pooled_entropy(data: Trajectories, taken: dict[int, str], rng: np.random.Generator) -> Estimate:
    sizes = sorted({len(word) for word in taken.values()})
    details = {
        f"{size}_obstacles": word_entropy(Counter(word for word in taken.values() if len(word) == size), size, rng)
        for size in sizes
    }
    return Estimate(
        None,
        "bits",
        "Entropy of the route classes over all configurations with one, two and three obstacles (in details): it mixes "
        "maps and is no measure of multimodality, but all that can be set beside labels that do not tell the map.",
        len(taken),
        note="one value a number of obstacles, in details",
        details=details,
    )
