"""A rule: a function from all episodes at once to what is wrong with some of them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from .episode_table import EpisodeTable
from .finding import Figure, Finding, Severity


@dataclass(frozen=True)
class Rule:
    """One rule.

    Attributes:
        find: yields the findings of a table.
        frames: columns of the frames that it reads.
        columns: episode columns that it reads.
        kinds: the kinds of data that it says something about.
        whole: it compares episodes with each other, or says something of the files as they lie; a part of the episodes
            is not enough to apply it.
    """

    name: str
    what: str
    find: Callable[[EpisodeTable], Iterable[Finding]]
    frames: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ("lerobot", "recordings")
    whole: bool = False


def each(
    table: EpisodeTable,
    where: np.ndarray,
    rule: str,
    figures: np.ndarray,
    limit: Figure,
    severity: Severity,
    message: str,
    episodes: np.ndarray | None = None,
) -> Iterator[Finding]:
    """One finding for every episode that a mask `(E,)` marks, with its own figure `(E,)`.

    Args:
        episodes: place of each entry in the table, where `where` covers only some of its episodes.
    """
    for place in np.flatnonzero(where):
        label = table.labels[place if episodes is None else episodes[place]]
        yield Finding(label, rule, _plain(figures[place]), limit, severity, message)


def _plain(value) -> Figure:
    return value.item() if isinstance(value, np.generic) else value
