"""Rules on the balance of a data set: episodes per map, and per pair and map."""

import functools
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from ..arrays import Array
from ..scenarios import base_name
from ..task import PairTask
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _maps(data: EpisodeData) -> Iterator[Finding]:
    weights_of_files = _file_weights(data)
    for name, counts in _counts_by_set(data).items():
        weights = _weights(data.task, name, counts, weights_of_files)
        maps, episodes = sorted(weights), sum(counts.values())
        proportions = np.array([weights[map_id] for map_id in maps]) / sum(weights.values())
        observed = np.array([counts[map_id] for map_id in maps])
        missing = int((observed == 0).sum())
        if missing and episodes >= len(maps):
            message = f"of the {len(maps)} maps of {name} have no episode"
            yield Finding("", "balance", missing, 0, "warning", message)
        expected = proportions * episodes
        if expected.min() < data.limit("balance.expected"):
            message = f"episodes for each map of {name}: too few to test whether they are balanced"
            yield Finding("", "balance", float(expected.min()), data.limit("balance.expected"), "info", message)
            continue
        from scipy.stats import chisquare  # takes longer to import than the other checks together

        p = float(chisquare(observed, expected).pvalue)
        if p < data.limit("balance.p"):
            message = f"the maps of {name} have {observed.min()} to {observed.max()} episodes; p of a chi-square test"
            yield Finding("", "balance", p, data.limit("balance.p"), "warning", message)


def _pairs(data: EpisodeData) -> Iterator[Finding]:
    pairs, maps = data.columns["pair_id"], _base_maps(data)
    has_pair = pairs != ""
    if not has_pair.any():
        return
    counts = Counter(pairs[has_pair].tolist())
    largest, smallest_pair = max(counts.values()), min(counts.values())
    if largest / smallest_pair > data.limit("balance.pairs"):
        message = f"the largest of {len(counts)} pairs has {largest} episodes, the smallest {smallest_pair}"
        yield Finding("", "balance_pairs", largest / smallest_pair, data.limit("balance.pairs"), "warning", message)
    if len(counts) < 2 or len(set(maps[has_pair])) < 2:
        return
    rows, columns = (np.unique(values[has_pair], return_inverse=True)[1] for values in (pairs, maps))
    cells = np.zeros((rows.max() + 1, columns.max() + 1), np.int64)
    np.add.at(cells, (rows, columns), 1)
    from scipy.stats import chi2_contingency

    result = chi2_contingency(cells)
    smallest = float(np.asarray(result[3]).min())
    if smallest < data.limit("balance.expected"):
        message = "episodes for each pair on each map: too few to test whether pairs and maps are independent"
        yield Finding("", "balance_pairs", smallest, data.limit("balance.expected"), "info", message)
    elif float(result[1]) < data.limit("balance.p"):  # pyright: ignore[reportArgumentType]
        message = "pairs did not carry on the same maps; p of a chi-square test of pair against map"
        yield Finding("", "balance_pairs", float(result[1]), data.limit("balance.p"), "warning", message)  # pyright: ignore[reportArgumentType]


def _counts_by_set(data: EpisodeData) -> dict[str, Counter[str]]:
    counts: dict[str, Counter[str]] = {}
    for name, map_id in zip(data.columns["map_set"].tolist(), _base_maps(data).tolist(), strict=True):
        counts.setdefault(name or "unnamed maps", Counter())[map_id] += 1
    return counts


def _base_maps(data: EpisodeData) -> Array:
    return np.array([base_name(name) for name in data.columns["map_id"].tolist()], str)


def _file_weights(data: EpisodeData) -> dict[str, int]:
    """Weight of each map from a file."""
    if "map_weight" not in data.columns:
        return {}
    return dict(zip(_base_maps(data).tolist(), data.columns["map_weight"].tolist(), strict=True))


def _weights(task: PairTask, name: str, counts: Counter[str], weights_of_files: Mapping[str, int]) -> dict[str, int]:
    """Expected relative frequency of each map of a family: its repetitions in the recorded set.

    Several sets contain maps of one family (the paper's 36 have the names of the training maps). Of the sets that
    contain all maps in `counts`, the smallest is taken; of equally large sets, the one with the best fit.
    """
    if name not in task.scenario_sets:
        return {map_id: max(1, weights_of_files.get(map_id, 1)) for map_id in counts}
    sets = [Counter(map_id for map_id, family in maps if family == name) for maps in _named_sets(task)]
    fitting = [weights for weights in sets if set(counts) <= set(weights)]
    return min(fitting, key=lambda set_: (len(set_), _chi_square(set_, counts)), default=dict.fromkeys(counts, 1))


@functools.cache
def _named_sets(task: PairTask) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Name and family of each map, for each set of the task."""
    return tuple(tuple(task.identify(scenario) for scenario in scenarios) for scenarios in task.scenario_sets.values())


def _chi_square(weights: Counter[str], counts: Counter[str]) -> float:
    """Pearson's chi-square statistic of the episode counts against the weights of a set."""
    scale = counts.total() / weights.total()
    return sum((counts[map_id] - weight * scale) ** 2 / (weight * scale) for map_id, weight in weights.items())


RULES = (
    Rule("balance", "the maps of a set are equally frequent", _maps, (), ("map_set", "map_id"), whole=True),
    Rule("balance_pairs", "pairs are equally frequent, on the same maps", _pairs, (), ("pair_id", "map_id"),
         whole=True),
)  # fmt: skip
