"""The schedule of a session: it balances scenarios and seats over all pairs."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from copolicy.dataset.task import PairTask, get_task

Configuration = tuple[str, int]
"""Scenario id and seating: 0 with player a on the robot seat, 1 with player b there."""


@dataclass
class EpisodeCounts:
    """Number of episodes per configuration.

    Attributes:
        kept: episodes in the folder that count, of all pairs and sessions.
        attempted: episodes of this session, kept or not.
        kept_in_session: episodes of this session that count.
    """

    kept: Counter[Configuration] = field(default_factory=Counter)
    attempted: Counter[Configuration] = field(default_factory=Counter)
    kept_in_session: Counter[Configuration] = field(default_factory=Counter)


class BalancedSchedule:
    """A seeded schedule that evens out the episode counts of all configurations.

    The next configuration is the one with the fewest kept episodes over all pairs. Ties are broken by the fewest
    attempts in this session, then by the scenario's attempts, then by what else the task balances
    (`PairTask.balanced`: start and goal of the table), then at random. The result depends only on the seed, the pair
    and the recordings in the folder: a session that is continued another day goes on with the same schedule, and a
    discarded episode is repeated after the others.

    Seats change once, in the middle of a session. A session begins with the seating that was kept less often.

    Attributes:
        planned: what the plan of a study says of the episode that was chosen last, for its recording; empty without.
        in_order: the number of kept episodes alone says which one is next, so that only the last one may be undone.
    """

    planned = ""
    in_order = False

    def __init__(
        self,
        scenarios: Sequence[Any],
        episodes: int,
        seed: int,
        pair: str,
        swap: bool,
        seating: int = 0,
        task: PairTask | None = None,
    ):
        """
        Args:
            scenarios: to choose from; duplicates count once, those of a file as often as their weight says.
            episodes: number of episodes to keep in the session.
            seed: of the random choice among ties.
            pair: name of the pair; part of the seed, so that pairs begin differently.
            swap: change seats in the middle; otherwise `seating` applies throughout.
            seating: of a session without a change of seats, see `Configuration`.
            task: of the scenarios; the table if None.
        """
        task = task or get_task()
        names = {task.name_of(scenario): scenario for scenario in scenarios}
        self._scenarios = {name.scenario: scenario for name, scenario in names.items()}
        self._weights = {name.scenario: name.weight for name in names}
        self._balanced = {name: list(enumerate(task.balanced(value))) for name, value in self._scenarios.items()}
        self._episodes = episodes
        self._entropy = [seed, *pair.encode()]
        self._swap = swap
        self._seating = seating

    def next(self, counts: EpisodeCounts) -> tuple[Any, int]:
        """Returns scenario and seating of the next episode."""
        seating = self.seating(counts)
        attempts: Counter[tuple[int, Hashable]] = Counter()
        for (name, _), count in counts.attempted.items():
            for key in self._balanced.get(name, ()):
                attempts[key] += count
        names = list(self._scenarios)
        tie_break = np.random.default_rng([*self._entropy, counts.attempted.total()]).permutation(len(names))

        def cost(index: int) -> tuple[float, ...]:
            name = names[index]
            own, swapped = (name, seating), (name, 1 - seating)
            weight = self._weights[name]
            return (
                counts.kept[own] / weight,
                counts.attempted[own] / weight,
                counts.attempted[swapped] / weight,
                counts.kept[swapped] / weight,
                sum(attempts[key] for key in self._balanced[name]),
                int(tie_break[index]),
            )

        return self._scenarios[names[min(range(len(names)), key=cost)]], seating

    def seating(self, counts: EpisodeCounts) -> int:
        """Returns the seating of the next episode, see `Configuration`."""
        if not self._swap:
            return self._seating
        before = Counter()
        for (_, seating), count in (counts.kept - counts.kept_in_session).items():
            before[seating] += count
        if before[0] != before[1]:
            first = int(before[1] < before[0])
        else:
            first = int(np.random.default_rng(self._entropy).integers(2))
        return first if counts.kept_in_session.total() < -(-self._episodes // 2) else 1 - first

    def practice(self, number: int) -> Any:
        """Returns the scenario of a practice episode, drawn independently of the schedule."""
        order = np.random.default_rng([*self._entropy, 1 << 20]).permutation(len(self._scenarios))
        return list(self._scenarios.values())[int(order[number % len(order)])]
