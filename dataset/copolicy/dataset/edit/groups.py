"""Which episodes of a data set belong together: those of a pair and its partners, of a map, or copies alone."""

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..scenarios import base_name
from .selection import Row, consents_of

By = Literal["pairs", "maps", "episodes"]
"""What stays together: people who carried together or with the same partner; a map; nothing but copies."""


def groups(rows: Sequence[Row], motions: Sequence[Hashable], by: By, same_consent: bool = False) -> list[list[int]]:
    """The places of the episodes that must stay together, each group ascending, in the order of their first.

    Episodes that are copies of each other (the same recording or motion) stay together in any case. `pairs`: a person
    who carried with two partners joins both pairs; scripted agents are meant to be met again, so that simulated
    episodes are joined by their pair alone; episodes of people who are not named stay together, as nobody can tell
    them apart. `maps`: a map with its start orientations and displaced copies.

    Args:
        motions: a digest of each episode's states and actions.
        same_consent: `pairs` only; a consent id in two pairs is the same person.
    """
    keys: dict[Hashable, int] = {}
    edges = [
        (place, len(rows) + keys.setdefault(key, len(keys)))
        for place, (row, motion) in enumerate(zip(rows, motions, strict=True))
        for key in (("motion", motion), *_keys(row, by, same_consent))
    ]
    if not edges:
        return []
    nodes = len(rows) + len(keys)
    graph = coo_array((np.ones(len(edges)), tuple(zip(*edges, strict=True))), (nodes, nodes))
    found: dict[int, list[int]] = defaultdict(list)
    for place, component in enumerate(connected_components(graph, directed=False)[1][: len(rows)].tolist()):
        found[component].append(place)
    return list(found.values())


def _keys(row: Row, by: By, same_consent: bool) -> Iterable[Hashable]:
    if row.get("source_sha256"):
        yield "recording", row["source_sha256"]
    if by == "maps":
        yield "map", base_map(row)
    elif by == "pairs":
        pair = row.get("pair_id") or ""
        if row.get("source") == "simulated":
            yield "simulated pair", pair
            return
        names = [row[column] for column in ("player_0_id", "player_1_id") if row.get(column)]
        yield from (("person", name) for name in names)
        if pair or not names:
            yield "pair", pair
        if same_consent:
            yield from (("consent", consent) for consent in consents_of(row))


def base_map(row: Row) -> str:
    """The map of an episode, whatever its start orientation."""
    return base_name(row.get("map_id") or "")
