"""Whether the maps, and the pairs over the maps, are there equally often."""

import functools
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np
from scipy.stats import chi2_contingency, chisquare

from ..scenarios import base_name
from ..task import PairTask
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _maps(table: EpisodeData) -> Iterator[Finding]:
    stated = _stated_weights(table)
    for name, counts in _by_set(table).items():
        weights = _weights(table.task, name, counts, stated)
        maps, episodes = sorted(weights), sum(counts.values())
        share = np.array([weights[one] for one in maps]) / sum(weights.values())
        found = np.array([counts[one] for one in maps])
        missing = int((found == 0).sum())
        if missing and episodes >= len(maps):
            message = f"of the {len(maps)} maps of {name} have no episode"
            yield Finding("", "balance", missing, 0, "warning", message)
        expected = share * episodes
        if expected.min() < table.limit("balance.expected"):
            message = f"episodes for each map of {name}: too few to tell whether they are balanced"
            yield Finding("", "balance", float(expected.min()), table.limit("balance.expected"), "info", message)
            continue
        p = float(chisquare(found, expected).pvalue)
        if p < table.limit("balance.p"):
            message = f"the maps of {name} have {found.min()} to {found.max()} episodes; p of a chi-square test"
            yield Finding("", "balance", p, table.limit("balance.p"), "warning", message)


def _pairs(table: EpisodeData) -> Iterator[Finding]:
    pairs, maps = table.columns["pair_id"], _base_maps(table)
    known = pairs != ""
    if not known.any():
        return
    counts = Counter(pairs[known].tolist())
    most, least = max(counts.values()), min(counts.values())
    if most / least > table.limit("balance.pairs"):
        message = f"the largest of {len(counts)} pairs has {most} episodes, the smallest {least}"
        yield Finding("", "balance_pairs", most / least, table.limit("balance.pairs"), "warning", message)
    if len(counts) < 2 or len(set(maps[known])) < 2:
        return
    rows, columns = np.unique(pairs[known], return_inverse=True)[1], np.unique(maps[known], return_inverse=True)[1]
    cells = np.zeros((rows.max() + 1, columns.max() + 1), np.int64)
    np.add.at(cells, (rows, columns), 1)
    result = chi2_contingency(cells)
    smallest = float(np.asarray(result[3]).min())
    if smallest < table.limit("balance.expected"):
        message = "episodes for each pair on each map: too few to tell whether pairs and maps are mixed"
        yield Finding("", "balance_pairs", smallest, table.limit("balance.expected"), "info", message)
    elif float(result[1]) < table.limit("balance.p"):  # pyright: ignore[reportArgumentType]
        message = "pairs did not carry on the same maps; p of a chi-square test of pair against map"
        yield Finding("", "balance_pairs", float(result[1]), table.limit("balance.p"), "warning", message)  # pyright: ignore[reportArgumentType]


def _by_set(table: EpisodeData) -> dict[str, Counter[str]]:
    counts: dict[str, Counter[str]] = {}
    for name, map_id in zip(table.columns["map_set"].tolist(), _base_maps(table).tolist(), strict=True):
        counts.setdefault(name or "unnamed maps", Counter())[map_id] += 1
    return counts


def _base_maps(table: EpisodeData) -> np.ndarray:
    return np.array([base_name(name) for name in table.columns["map_id"].tolist()], str)


def _stated_weights(table: EpisodeData) -> dict[str, int]:
    """Of the maps of files, by map."""
    if "map_weight" not in table.columns:
        return {}
    return dict(zip(_base_maps(table).tolist(), table.columns["map_weight"].tolist(), strict=True))


def _weights(task: PairTask, name: str, counts: Counter[str], stated: Mapping[str, int]) -> dict[str, int]:
    """How often each map of a family should be there: as often as the set that was recorded repeats it.

    Several sets have maps of one family (the paper's 36 carry the names of the training maps): of those with all the
    maps that are there, the one with the fewest others, and of these the one that fits best.
    """
    if name not in task.scenario_sets:
        return {map_id: max(1, stated.get(map_id, 1)) for map_id in counts}
    sets = [Counter(map_id for map_id, family in maps if family == name) for maps in _named_sets(task)]
    fitting = [weights for weights in sets if set(counts) <= set(weights)]
    return min(fitting, key=lambda weights: (len(weights), _misfit(weights, counts)), default=dict.fromkeys(counts, 1))


@functools.cache
def _named_sets(task: PairTask) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Name and family of each map of each set."""
    return tuple(tuple(task.identify(scenario) for scenario in scenarios) for scenarios in task.scenario_sets.values())


def _misfit(weights: Counter[str], counts: Counter[str]) -> float:
    """Pearson's statistic of the episodes against the shares of a set."""
    share = counts.total() / weights.total()
    return sum((counts[one] - weight * share) ** 2 / (weight * share) for one, weight in weights.items())


RULES = (
    Rule("balance", "the maps of a set are equally frequent", _maps, (), ("map_set", "map_id"), whole=True),
    Rule(
        "balance_pairs", "pairs are equally frequent, on the same maps", _pairs, (), ("pair_id", "map_id"), whole=True
    ),
)
