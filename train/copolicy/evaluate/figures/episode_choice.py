"""Chooses the episode of each source whose path is drawn."""

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask

from ..trajectories import Trajectory
from ..trajectory_sources import Source
from .samples import interaction_of

RULE = (
    "the map with successes of most sources (of equals the first, in the order of the sources), and there of each "
    "source the success with the median of the mean magnitude (the lower of two); of a source without a success there "
    "the median of all its successes, or of all its episodes if it has none"
)
"""Choice of the episodes that are not named."""


class Chosen(NamedTuple):
    """The episode of a source that is drawn; the number is as in `Source.numbers`."""

    source: Source
    number: int
    episode: Trajectory


def chosen_episodes(task: PairTask, sources: Sequence[Source], named: Sequence[str]) -> tuple[list[Chosen], str]:
    """One episode of each source, and the rule of the choice.

    Args:
        named: `NAME=NUMBER` texts, for some or all sources; the others follow `RULE`.

    Raises:
        InvalidValueError: no such source or episode.
    """
    numbers = _named_numbers(sources, named)
    free = [source for source in sources if source.name not in numbers]
    chosen = {source.name: index for source, index in zip(free, _by_rule(task, free), strict=True)}
    chosen |= {
        source.name: list(source.numbers).index(numbers[source.name]) for source in sources if source.name in numbers
    }
    said = f"by --episode: {', '.join(numbers)}" if numbers else ""
    return (
        [
            Chosen(source, source.numbers[chosen[source.name]], source.episodes[chosen[source.name]])
            for source in sources
        ],
        "; ".join(text for text in (said, RULE if free else "") if text),
    )


def measured_interaction(task: PairTask, episode: Trajectory) -> Array:
    """`(T,)` the interaction measure of each action; the task must have one."""
    interaction = interaction_of(task, episode)
    assert interaction is not None
    return interaction


def _named_numbers(sources: Sequence[Source], named: Sequence[str]) -> dict[str, int]:
    by_name = {source.name: source for source in sources}
    numbers = {}
    for text in named:
        name, sign, number = text.rpartition("=")
        if not sign or name not in by_name or not number.isdecimal():
            raise InvalidValueError("--episode", f"NAME=NUMBER with a source of {', '.join(by_name)}", text)
        if int(number) not in by_name[name].numbers:
            last = max(by_name[name].numbers)
            raise InvalidValueError("--episode", f"an episode of {name} (0 to {last}, without excluded ones)", text)
        numbers[name] = int(number)
    return numbers


def _by_rule(task: PairTask, sources: Sequence[Source]) -> list[int]:
    """Index of an episode of each source, see `RULE`."""
    of_source: list[dict[Any, list[int]]] = []
    for source in sources:
        by_layout: dict[Any, list[int]] = {}
        for index, episode in enumerate(source.episodes):
            if episode.columns["success"]:
                by_layout.setdefault(task.layout(episode.scenario, with_goal=True), []).append(index)
        of_source.append(by_layout)
    counts = Counter(layout for by_layout in of_source for layout in by_layout)
    common = max(counts, key=lambda layout: counts[layout]) if counts else None  # of equals the first
    indices = []
    for source, by_layout in zip(sources, of_source, strict=True):
        successes = sorted(index for each in by_layout.values() for index in each)
        indices.append(_median(task, source, by_layout.get(common) or successes or range(len(source.episodes))))
    return indices


def _median(task: PairTask, source: Source, indices: Sequence[int]) -> int:
    means = [float(np.abs(measured_interaction(task, source.episodes[index])).mean()) for index in indices]
    return indices[int(np.argsort(means, kind="stable")[(len(means) - 1) // 2])]
