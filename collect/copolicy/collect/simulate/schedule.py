"""Which pair carries the table on which map, episode by episode."""

from collections.abc import Sequence

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError


def balanced_schedule(maps: int, pairs: Sequence[str], episodes: int, seed: int) -> list[tuple[int, str]]:
    """Index of the map and name of the pair of each episode, shuffled by `seed`.

    Every `maps` episodes visit each map once and share the pairs out evenly (to one more or less); every
    `maps * len(pairs)` episodes bring each pair to each map exactly once. A shorter schedule is the beginning of a
    longer one with the same seed.

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
        # Shuffled maps, dealt out so that consecutive episodes have different pairs.
        shuffled = rng.permutation(maps)
        place_in_pair = np.zeros(maps, int)
        for pair in range(len(pairs)):
            own = shuffled[pair_of_map[shuffled] == pair]
            place_in_pair[own] = np.arange(len(own))
        order = shuffled[np.argsort(place_in_pair[shuffled], kind="stable")]
        schedule += [(int(index), pairs[int(pair_of_map[index])]) for index in order]
    return schedule[:episodes]
