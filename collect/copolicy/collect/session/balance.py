"""Which map and which seats come next, so that every configuration gets its share across pairs."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.dataset.task import PairTask, get_task

Configuration = tuple[str, int]
"""Map id, and who sits where: 0 with player a on the robot's seat, 1 with player b there."""


@dataclass
class Counts:
    """How often each configuration was played.

    Attributes:
        kept: episodes in the folder that count, of all pairs and sessions.
        tried: episodes of this session, whatever became of them.
        kept_here: episodes of this session that count.
    """

    kept: Counter[Configuration] = field(default_factory=Counter)
    tried: Counter[Configuration] = field(default_factory=Counter)
    kept_here: Counter[Configuration] = field(default_factory=Counter)


class Balance:
    """A seeded schedule that looks at what there is already.

    The next configuration is the one that was kept least often over all pairs; among equals the one that this
    session tried least, then the map, then what else the task balances (`PairTask.balanced`: start and goal of the
    table), then chance. It depends on the seed, the pair and the recordings in the folder alone: a session that goes
    on another day goes on where it was, a discarded episode comes back after the others.

    Seats change once, in the middle of a session, and the session begins with the seats that were kept less.
    """

    def __init__(
        self,
        maps: Sequence[Any],
        episodes: int,
        seed: int,
        pair: str,
        swap: bool,
        seating: int = 0,
        task: PairTask | None = None,
    ):
        """
        Args:
            maps: to choose from; repeated ones count once, one of a file as often as its weight says.
            episodes: that the session is to keep.
            seed: of the choice among equals.
            pair: its name, so that pairs begin differently.
            swap: seats change in the middle; otherwise they stay as they are.
            seating: who sits where if they stay, see `Configuration`.
            task: of the maps; the table if None.
        """
        task = task or get_task()
        names = {task.name_of(config): config for config in maps}
        self._maps = {name.scenario: config for name, config in names.items()}
        self._weights = {name.scenario: name.weight for name in names}
        self._places = {name: list(enumerate(task.balanced(config))) for name, config in self._maps.items()}
        self._episodes = episodes
        self._entropy = [seed, *pair.encode()]
        self._swap = swap
        self._seating = seating

    def next(self, counts: Counts) -> tuple[Any, int]:
        """Map and seats of the next episode."""
        seating = self.seating(counts)
        met: Counter[tuple[int, Hashable]] = Counter()
        for (name, _), count in counts.tried.items():
            for place in self._places.get(name, ()):
                met[place] += count
        names = list(self._maps)
        chance = np.random.default_rng([*self._entropy, counts.tried.total()]).permutation(len(names))

        def burden(index: int) -> tuple[float, ...]:
            name = names[index]
            own, other = (name, seating), (name, 1 - seating)
            weight = self._weights[name]
            return (
                counts.kept[own] / weight,
                counts.tried[own] / weight,
                counts.tried[other] / weight,
                counts.kept[other] / weight,
                sum(met[place] for place in self._places[name]),
                int(chance[index]),
            )

        return self._maps[names[min(range(len(names)), key=burden)]], seating

    def seating(self, counts: Counts) -> int:
        """Who sits where in the next episode."""
        if not self._swap:
            return self._seating
        before = Counter()
        for (_, seating), count in (counts.kept - counts.kept_here).items():
            before[seating] += count
        if before[0] != before[1]:
            first = int(before[1] < before[0])
        else:
            first = int(np.random.default_rng(self._entropy).integers(2))
        return first if counts.kept_here.total() < -(-self._episodes // 2) else 1 - first

    def practice(self, number: int) -> Any:
        """The map of a practice episode, drawn apart from the schedule."""
        order = np.random.default_rng([*self._entropy, 1 << 20]).permutation(len(self._maps))
        return list(self._maps.values())[int(order[number % len(order)])]
