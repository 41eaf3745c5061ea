"""The parts of a split, and the assignment of groups of episodes to them; no group is in two parts."""

import re
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..exceptions import InvalidValueError, RunError
from .groups import By, base_map
from .selection import Row

REST = "rest"
Groups = Sequence[Sequence[int]]
Assignment = dict[str, list[int]]
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Part:
    """A requested part of a split.

    Attributes:
        proportion: proportion of the episodes that no part names; None for a part of named pairs or maps.
        names: names of pairs or maps.
    """

    name: str
    proportion: float | None
    names: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> "Part":
        """Parses `NAME=0.8`, `NAME=ID,ID` or `NAME=rest`.

        Raises:
            InvalidValueError: another form, or a proportion outside (0, 1].
        """
        name, _, value = text.partition("=")
        if not re.fullmatch(r"[A-Za-z0-9][\w.-]*", name) or not value:
            raise InvalidValueError("--parts", "NAME=PROPORTION, NAME=ID,ID or NAME=rest", text)
        if value == REST:
            return cls(name, 1.0)
        try:
            proportion = float(value)
        except ValueError:
            return cls(name, None, tuple(part for part in value.split(",") if part))
        if not 0 < proportion <= 1:
            raise InvalidValueError("--parts", "a proportion above 0 and up to 1", text)
        return cls(name, proportion)


def parse_parts(texts: Sequence[str]) -> list[Part]:
    """Parses the parts of a split.

    Raises:
        InvalidValueError: fewer than two parts, a repeated name, proportions that do not sum to 1, or both
            proportions and rest.
    """
    parts = [Part.parse(text) for text in texts]
    if len(parts) < 2 or len({part.name for part in parts}) != len(parts):
        raise InvalidValueError("--parts", "at least two parts of different names", list(texts))
    proportions = [part.proportion for part in parts if part.proportion is not None]
    rests = sum(text.partition("=")[2] == REST for text in texts)
    if rests > 1 or (rests and len(proportions) > 1):
        raise InvalidValueError("--parts", "rest at most once and without proportions", list(texts))
    if proportions and abs(sum(proportions) - 1) > _TOLERANCE:
        raise InvalidValueError("--parts", "proportions that sum to 1", list(texts))
    return parts


def assign_groups(
    rows: Sequence[Row], groups: Groups, parts: Sequence[Part], by: By, seed: int, flag: str = "--parts"
) -> Assignment:
    """Assigns groups of episodes to parts; returns the ascending episode indices of each part.

    Groups that a part names go to it. The others are assigned from the largest to the smallest, groups of equal size
    in random order, each to the part that is furthest below its proportion, within its stratum (source and map set;
    for single episodes also pair, map and success) and overall.

    Raises:
        RunError: a name that no episode has, two named parts that share a group, or a part that stays empty.
    """
    assignment: Assignment = {part.name: [] for part in parts}
    unassigned = _assign_named(rows, groups, parts, by, assignment)
    proportions = {part.name: part.proportion for part in parts if part.proportion is not None}
    if not proportions and unassigned:
        count = sum(len(group) for group in unassigned)
        raise RunError(f"--parts: expected a part for every episode, found {count} without one; add NAME=rest")
    if by == "episodes":
        _assign_spread(rows, unassigned, proportions, assignment, seed)
    else:
        _assign_balanced(rows, unassigned, proportions, assignment, seed)
    _fill_empty(assignment, unassigned, proportions)
    empty = [name for name, indices in assignment.items() if not indices]
    if empty:
        unit = {"pairs": "groups of people", "maps": "maps", "episodes": "episodes"}[by]
        raise RunError(
            f"{flag}: expected at least one of the {unit} for each part, found {len(groups)} for {len(parts)} "
            f"parts; {empty[0]} is empty"
        )
    return {name: sorted(indices) for name, indices in assignment.items()}


def _assign_named(
    rows: Sequence[Row], groups: Groups, parts: Sequence[Part], by: By, assignment: Assignment
) -> list[Sequence[int]]:
    """Assigns the groups that parts name; returns the other groups."""
    owner: dict[str, str] = {}
    for part in parts:
        for name in part.names:
            if owner.setdefault(name, part.name) != part.name:
                raise InvalidValueError("--parts", "each name in one part", name)
    if owner and by == "episodes":
        raise InvalidValueError("--parts", "--by pairs or --by maps with names", sorted(owner)[0])
    others: list[Sequence[int]] = []
    unknown = set(owner)
    for group in groups:
        names = {name for index in group for name in _group_names(rows[index], by)}
        unknown -= names
        targets = {owner[name]: name for name in sorted(names) if name in owner}
        if len(targets) > 1:
            (part_a, name_a), (part_b, name_b) = list(targets.items())[:2]
            raise RunError(f"--parts: {name_a} ({part_a}) and {name_b} ({part_b}) share a person or a recording")
        if targets:
            assignment[next(iter(targets))] += group
        else:
            others.append(group)
    if unknown:
        raise RunError(f"--parts: expected {by} of the data set, found {sorted(unknown)[0]!r}, which no episode has")
    return others


def _group_names(row: Row, by: By) -> set[str]:
    if by == "maps":
        return {base_map(row), row.get("map_id") or ""}
    return {row.get(column) or "" for column in ("pair_id", "player_0_id", "player_1_id")}


def _assign_balanced(
    rows: Sequence[Row], groups: Groups, proportions: Mapping[str, float], assignment: Assignment, seed: int
) -> None:
    order = np.random.default_rng(seed).permutation(len(groups))
    ordered = sorted((groups[int(number)] for number in order), key=len, reverse=True)
    totals = Counter(_stratum(rows[index]) for group in groups for index in group)
    assigned: dict[str, Counter] = defaultdict(Counter)
    for group in ordered:
        strata = Counter(_stratum(rows[index]) for index in group)

        def shortfall(name: str, strata: Counter = strata) -> float:
            within = sum(n * (proportions[name] - assigned[name][key] / totals[key]) for key, n in strata.items())
            return within / strata.total() + proportions[name] - assigned[name].total() / totals.total()

        best = max(proportions, key=shortfall)
        assigned[best].update(strata)
        assignment[best] += group


def _assign_spread(
    rows: Sequence[Row], groups: Groups, proportions: Mapping[str, float], assignment: Assignment, seed: int
) -> None:
    """Assigns episodes in the order of their strata, so that each part has its proportion of every stratum."""
    draw = np.random.default_rng(seed)
    random_order = draw.permutation(len(groups))
    strata = [(*_stratum(rows[group[0]]), *_sub_stratum(rows[group[0]])) for group in groups]
    ordered = sorted(range(len(groups)), key=lambda number: (strata[number], random_order[number]))
    assigned = Counter()
    for number in ordered:
        total = assigned.total() + len(groups[number])
        best = max(proportions, key=lambda name: proportions[name] * total - assigned[name])
        assigned[best] += len(groups[number])
        assignment[best] += groups[number]


def _fill_empty(assignment: Assignment, groups: Groups, proportions: Mapping[str, float]) -> None:
    """Moves to each empty part the smallest group of a part with several groups."""
    for name in proportions:
        if assignment[name]:
            continue
        owned = {part: [group for group in groups if group[0] in set(assignment[part])] for part in proportions}
        donors = [(min(own, key=len), part) for part, own in owned.items() if len(own) > 1]
        if donors:
            group, donor = min(donors, key=lambda entry: len(entry[0]))
            moved = set(group)
            assignment[donor] = [index for index in assignment[donor] if index not in moved]
            assignment[name] = list(group)


def _stratum(row: Row) -> tuple[str, ...]:
    return row.get("source") or "", row.get("map_set") or ""


def _sub_stratum(row: Row) -> tuple[Any, ...]:
    return row.get("pair_id") or "", bool(row.get("success")), base_map(row)
