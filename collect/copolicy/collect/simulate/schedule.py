"""A balanced schedule of pairs and maps over episodes."""

from collections.abc import Sequence

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError


def balanced_schedule(maps: int, pairs: Sequence[str], episodes: int, seed: int) -> list[tuple[int, str]]:
    """Index of the map and name of the pair of each episode, shuffled by `seed`.

    Every `maps` episodes use each map once and each pair equally often (to one); every `maps * len(pairs)` episodes
    use each pair on each map exactly once. A shorter schedule is the beginning of a longer one with the same seed.

    Raises:
        InvalidValueError: no map, no pair, or a negative number of episodes.
    """
    if maps < 1 or not pairs:
        raise InvalidValueError("schedule", "at least one map and one pair", (maps, tuple(pairs)))
    if episodes < 0:
        raise InvalidValueError("episodes", "a number that is not negative", episodes)
    rng = np.random.default_rng(seed)
    first_pair = rng.permutation(np.arange(maps) % len(pairs))
    schedule: list[tuple[int, str]] = []
    for visit in range(-(-episodes // maps)):
        pair_of_map = (first_pair + visit) % len(pairs)
        # Shuffled maps, ordered so that consecutive episodes have different pairs.
        shuffled = rng.permutation(maps)
        rank_in_pair = np.zeros(maps, int)
        for pair in range(len(pairs)):
            maps_of_pair = shuffled[pair_of_map[shuffled] == pair]
            rank_in_pair[maps_of_pair] = np.arange(len(maps_of_pair))
        order = shuffled[np.argsort(rank_in_pair[shuffled], kind="stable")]
        schedule += [(int(index), pairs[int(pair_of_map[index])]) for index in order]
    return schedule[:episodes]
