"""Groups episodes that must stay in one part of a split: by pair and partners, by map, or only copies."""

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence
from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..scenarios import base_name
from .selection import Row, consent_ids

By = Literal["pairs", "maps", "episodes"]
"""Unit of a group: players who acted together or with the same partner; a map; a single episode and its copies."""


def group_episodes(
    rows: Sequence[Row], motions: Sequence[Hashable], by: By, same_consent: bool = False
) -> list[list[int]]:
    """Groups the indices of episodes that must stay together; indices ascend, groups are ordered by their first.

    Copies (the same recording or motion) always stay together. `pairs`: a person with two partners joins both pairs;
    simulated episodes are joined only by their pair, because scripted agents may occur in several parts; episodes of
    unnamed people form one group, because they may be the same person. `maps`: a map with its start orientations and
    displaced copies.

    Args:
        motions: digest of states and actions of each episode.
        same_consent: `pairs` only; a consent id in two pairs is the same person.
    """
    keys: dict[Hashable, int] = {}
    edges = [
        (index, len(rows) + keys.setdefault(key, len(keys)))
        for index, (row, motion) in enumerate(zip(rows, motions, strict=True))
        for key in (("motion", motion), *_group_keys(row, by, same_consent))
    ]
    if not edges:
        return []
    nodes = len(rows) + len(keys)
    graph = coo_array((np.ones(len(edges)), tuple(zip(*edges, strict=True))), (nodes, nodes))
    groups: dict[int, list[int]] = defaultdict(list)
    for index, component in enumerate(connected_components(graph, directed=False)[1][: len(rows)].tolist()):
        groups[component].append(index)
    return list(groups.values())


def _group_keys(row: Row, by: By, same_consent: bool) -> Iterable[Hashable]:
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
            yield from (("consent", consent) for consent in consent_ids(row))


def base_map(row: Row) -> str:
    """The map of an episode without its start orientation."""
    return base_name(row.get("map_id") or "")
