"""Multimodality of the steering before the first obstacle, by Hartigan's dip test."""

import numpy as np
from diptest import dipstat
from diptest.consts import Consts
from scipy.stats import false_discovery_control

from copolicy.dataset.arrays import Array
from copolicy.dataset.statistics.estimate import Estimate, Null
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.trajectories import Trajectories

MIN_EPISODES = 8
"""Fewest episodes for a dip test; below about 20 it detects only modes that are far apart."""

MAX_QUERIES = 2_000
RADIUS_PX = 50.0
AHEAD_S = 0.5
FALSE_DISCOVERY_RATE = 0.05
_NULL_DRAWS = 39

_STEERING = (
    "Steering: the component across start-goal of both players' forces together. Decision zone: from the start until "
    "the table's centre is as far along start-goal as the near side of the first obstacle."
)


def decision_zone(data: Trajectories) -> Array:
    """`(N,)` whether a frame is in the decision zone, that is, before the first obstacle's station.

    The station is the projection on the line from start to goal. An episode leaves the zone when the table first
    reaches the near side of the obstacle. Maps without obstacles have no zone.
    """
    zone = np.zeros(len(data.states), dtype=bool)
    for index, row in enumerate(data.rows):
        if not row.scenario.obstacles:
            continue
        origin, along = _axis(row.scenario)
        squares = row.scenario.squares
        first = min(float((np.array(centre) - origin) @ along) - size / 2 for centre, size in squares)
        station = (data.path(index) - origin) @ along
        zone[data.starts[index] : data.ends[index]] = np.maximum.accumulate(station) < first
    return zone


def steering(data: Trajectories) -> Array:
    """`(N,)` joint force across the line from start to goal, positive to its right on screen, in full forces."""
    total = data.actions[:, :2] + data.actions[:, 2:]
    across = np.array([(-along[1], along[0]) for along in (_axis(row.scenario)[1] for row in data.rows)])
    return (total * across[data.episode]).sum(axis=1)


def dip_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Dip tests at positions of the decision zone, and one for each configuration."""
    zone, sideways = decision_zone(data), steering(data)
    return {
        "steering_dip": _local(data, zone, _ahead(data, sideways), bootstrap, rng),
        "steering_dip_by_configuration": _by_configuration(data, zone, sideways, rng),
    }


def _local(data: Trajectories, zone, ahead, bootstrap: Bootstrap, rng) -> Estimate:
    definition = (
        f"{_STEERING} Proportion of its states at which the steering over the next {AHEAD_S} s of other episodes with "
        f"the same goal and obstacles, at their position nearest to it within {RADIUS_PX:g} px, one value an episode, "
        f"is not unimodal (dip test, false discovery rate {FALSE_DISCOVERY_RATE})."
    )
    per_query: list[tuple[int, Array]] = []
    inside = np.flatnonzero(zone)
    proportion = min(1.0, MAX_QUERIES / max(len(inside), 1))
    for group in data.groups(with_goal=True):
        if len(group) <= MIN_EPISODES:
            continue
        frames = inside[np.isin(data.episode[inside], group)]
        for query in rng.permutation(frames)[: max(1, round(proportion * len(frames)))] if len(frames) else ():
            sample = _sample(data, frames, query, ahead)
            if len(sample) >= MIN_EPISODES:
                per_query.append((int(data.episode[query]), sample))
    if not per_query:
        note = f"no position in a decision zone with {MIN_EPISODES} other episodes within {RADIUS_PX:g} px"
        return Estimate(None, "1", definition, 0, note=note)
    rejected = _rejected([sample for _, sample in per_query])
    hits, queries = np.zeros(len(data.rows)), np.zeros(len(data.rows))
    np.add.at(queries, [episode for episode, _ in per_query], 1)
    np.add.at(hits, [episode for episode, _ in per_query], rejected)
    value, bounds = bootstrap.ratio(hits, queries)
    null_shares = [
        _rejected([rng.standard_normal(len(sample)) for _, sample in per_query]).mean() for _ in range(_NULL_DRAWS)
    ]
    null = Null.from_draws("one Gaussian of as many episodes at each place", value or 0.0, np.array(null_shares))
    sizes = [len(sample) for _, sample in per_query]
    details = {"places": len(per_query), "median_episodes_at_a_place": float(np.median(sizes))}
    episodes = int((queries > 0).sum())
    return Estimate(value, "1", definition, episodes, bounds, bootstrap.resampled, null, details=details)


def _by_configuration(data: Trajectories, zone, sideways, rng) -> Estimate:
    definition = (
        f"{_STEERING} Proportion of configurations in which its mean over the zone, one value an episode, is not "
        f"unimodal (dip test, false discovery rate {FALSE_DISCOVERY_RATE})."
    )
    frames = data.per_episode(zone)
    mean = np.divide(data.per_episode(zone * sideways), frames, out=np.full(len(frames), np.nan), where=frames > 0)
    tests: dict[str, dict] = {}
    for name in np.unique(data.configurations):
        sample = mean[(data.configurations == name) & np.isfinite(mean)]
        if len(sample) >= MIN_EPISODES:
            (dip,), (p,) = dip_tests([sample])
            tests[str(name)] = {"episodes": len(sample), "dip": float(dip), "p": float(p)}
    if not tests:
        return Estimate(None, "1", definition, 0, note=f"no configuration has {MIN_EPISODES} episodes and obstacles")
    adjusted = false_discovery_control([test["p"] for test in tests.values()])
    for test, p in zip(tests.values(), adjusted, strict=True):
        test["p_adjusted"] = float(p)
    rejected = adjusted < FALSE_DISCOVERY_RATE
    draws = [
        _rejected([rng.standard_normal(test["episodes"]) for test in tests.values()]).mean() for _ in range(_NULL_DRAWS)
    ]
    value = float(rejected.mean())
    resampled = rng.binomial(len(rejected), value, size=1000) / len(rejected)
    bounds = (float(np.quantile(resampled, 0.025)), float(np.quantile(resampled, 0.975)))
    null = Null.from_draws("one Gaussian of as many episodes in each configuration", value, np.array(draws))
    episodes = sum(test["episodes"] for test in tests.values())
    details = {"configurations": tests}
    return Estimate(value, "1", definition, episodes, bounds, "configurations", null, details=details)


def dip_tests(samples: list[Array]) -> tuple[Array, Array]:
    """Dips of the samples and p-values by Hartigan's table, as of `diptest.diptest`, which takes one sample.

    Args:
        samples: at least four values each.
    """
    sizes = np.array([len(sample) for sample in samples])
    dips = np.array([dipstat(sample) for sample in samples])
    p = np.empty(len(samples))
    for size in np.unique(sizes):
        of_size = sizes == size
        critical = _critical(int(size))
        p[of_size] = 1.0 - np.interp(np.sqrt(size) * dips[of_size], critical, Consts._ALPHA)
    return dips, np.clip(p, 0.0, 1.0)


def _critical(size: int) -> Array:
    """Hartigan's critical values of sqrt(n) times the dip of n = `size` values, interpolated between table rows."""
    sizes, values = Consts._SAMPLE_SIZE, Consts._CRIT_VALS
    above = min(int(sizes.searchsorted(size)), len(sizes) - 1)
    below = max(0, above - 1) if size <= sizes[-1] else above
    low = np.sqrt(sizes[below]) * values[below]
    if below == above:
        return low
    fraction = float(size - sizes[below]) / (sizes[above] - sizes[below])
    return low + fraction * (np.sqrt(sizes[above]) * values[above] - low)


def _rejected(samples: list[Array]) -> Array:
    return false_discovery_control(dip_tests(samples)[1]) < FALSE_DISCOVERY_RATE


def _sample(data: Trajectories, frames: Array, query: int, ahead: Array) -> Array:
    """Steering of each other episode at its frame nearest to the query's position, within `RADIUS_PX`."""
    distance = np.linalg.norm(data.states[frames, :2] - data.states[query, :2], axis=1)
    near = (distance <= RADIUS_PX) & (data.episode[frames] != data.episode[query])
    frames, distance = frames[near], distance[near]
    order = np.lexsort((distance, data.episode[frames]))
    frames = frames[order]
    first = np.flatnonzero(np.diff(data.episode[frames], prepend=-1))
    return ahead[frames[first]]


def _ahead(data: Trajectories, values: Array) -> Array:
    """Mean of a value over the next `AHEAD_S` of each frame, within its episode."""
    window = max(1, round(AHEAD_S * data.fps))
    total = np.concatenate(([0.0], np.cumsum(values)))
    begin = np.arange(len(values))
    end = np.minimum(begin + window, data.ends[data.episode])
    return (total[end] - total[begin]) / (end - begin)


def _axis(config) -> tuple[Array, Array]:
    origin = np.array(config.start[:2])
    line = np.array(config.goal) - origin
    return origin, line / max(float(np.linalg.norm(line)), 1e-9)
