"""The parts of a split, and how groups of episodes are dealt out to them so that no group is in two."""

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
_TOLERANCE = 1e-6


@dataclass(frozen=True)
class Part:
    """A part as it was asked for.

    Attributes:
        proportion: of the episodes that no part names; None for a part of named pairs or maps.
        names: pairs or maps.
    """

    name: str
    proportion: float | None
    names: tuple[str, ...] = ()

    @classmethod
    def parse(cls, text: str) -> "Part":
        """Reads `NAME=0.8`, `NAME=ID,ID` or `NAME=rest`.

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
    """Reads the parts of a split.

    Raises:
        InvalidValueError: fewer than two, one name twice, proportions that do not sum to 1, or rest beside them.
    """
    parts = [Part.parse(text) for text in texts]
    if len(parts) < 2 or len({part.name for part in parts}) != len(parts):
        raise InvalidValueError("--parts", "at least two parts of different names", list(texts))
    proportions = [part.proportion for part in parts if part.proportion is not None]
    rests = sum(text.partition("=")[2] == REST for text in texts)
    if rests > 1 or (rests and len(proportions) > 1):
        raise InvalidValueError("--parts", "rest once, and no proportion beside it", list(texts))
    if proportions and abs(sum(proportions) - 1) > _TOLERANCE:
        raise InvalidValueError("--parts", "proportions that sum to 1", list(texts))
    return parts


def deal(
    rows: Sequence[Row],
    together: Sequence[Sequence[int]],
    parts: Sequence[Part],
    by: By,
    seed: int,
    flag: str = "--parts",
) -> dict[str, list[int]]:
    """The places of the episodes of each part, ascending.

    Groups that a part names go there. The others are dealt out, the largest first, equal ones in an order drawn by
    the seed, each to the part that lacks most of its proportion, within its kind of episodes (source and map set; for
    single episodes also pair, map and success) and over all.

    Raises:
        RunError: a name that no episode has, one that is tied to a name of another part, or a part that stays empty.
    """
    dealt: dict[str, list[int]] = {part.name: [] for part in parts}
    rest = _named(rows, together, parts, by, dealt)
    proportions = {part.name: part.proportion for part in parts if part.proportion is not None}
    if not proportions and rest:
        left = sum(len(group) for group in rest)
        raise RunError(f"--parts: expected a part for every episode, found {left} in none; add NAME=rest")
    if by == "episodes":
        _spread(rows, rest, proportions, dealt, seed)
    else:
        _balance(rows, rest, proportions, dealt, seed)
    _fill_empty(dealt, rest, proportions)
    empty = [name for name, places in dealt.items() if not places]
    if empty:
        what = {"pairs": "groups of people", "maps": "maps", "episodes": "episodes"}[by]
        raise RunError(
            f"{flag}: expected at least one of the {what} for each part, found {len(together)} for {len(parts)} "
            f"parts: none is left for {empty[0]}"
        )
    return {name: sorted(places) for name, places in dealt.items()}


def _named(
    rows: Sequence[Row], together: Sequence[Sequence[int]], parts: Sequence[Part], by: By, dealt: dict[str, list[int]]
) -> list[Sequence[int]]:
    """Deals out the groups that are named; returns the others."""
    owner: dict[str, str] = {}
    for part in parts:
        for name in part.names:
            if owner.setdefault(name, part.name) != part.name:
                raise InvalidValueError("--parts", "each name in one part", name)
    if owner and by == "episodes":
        raise InvalidValueError("--parts", "--by pairs or --by maps beside names", sorted(owner)[0])
    rest: list[Sequence[int]] = []
    unseen = set(owner)
    for group in together:
        inside = {name for place in group for name in _names(rows[place], by)}
        unseen -= inside
        wanted = {owner[name]: name for name in sorted(inside) if name in owner}
        if len(wanted) > 1:
            (part_a, name_a), (part_b, name_b) = list(wanted.items())[:2]
            raise RunError(f"--parts: {name_a} ({part_a}) and {name_b} ({part_b}) share a person or a recording")
        if wanted:
            dealt[next(iter(wanted))] += group
        else:
            rest.append(group)
    if unseen:
        raise RunError(f"--parts: expected {by} that an episode has, found {sorted(unseen)[0]!r}, which none has")
    return rest


def _names(row: Row, by: By) -> set[str]:
    if by == "maps":
        return {base_map(row), row.get("map_id") or ""}
    return {row.get(column) or "" for column in ("pair_id", "player_0_id", "player_1_id")}


def _balance(
    rows: Sequence[Row],
    rest: Sequence[Sequence[int]],
    proportions: Mapping[str, float],
    dealt: dict[str, list[int]],
    seed: int,
) -> None:
    order = np.random.default_rng(seed).permutation(len(rest))
    ordered = sorted((rest[int(number)] for number in order), key=len, reverse=True)
    totals = Counter(_kind(rows[place]) for group in rest for place in group)
    have: dict[str, Counter] = defaultdict(Counter)
    for group in ordered:
        kinds = Counter(_kind(rows[place]) for place in group)

        def lack(name: str, kinds: Counter = kinds) -> float:
            inside = sum(count * (proportions[name] - have[name][kind] / totals[kind]) for kind, count in kinds.items())
            return inside / kinds.total() + proportions[name] - have[name].total() / totals.total()

        best = max(proportions, key=lack)
        have[best].update(kinds)
        dealt[best] += group


def _spread(
    rows: Sequence[Row],
    rest: Sequence[Sequence[int]],
    proportions: Mapping[str, float],
    dealt: dict[str, list[int]],
    seed: int,
) -> None:
    """Goes through the episodes, kind after kind, and keeps every part near its proportion all the way."""
    draw = np.random.default_rng(seed)
    chance = draw.permutation(len(rest))
    kinds = [(*_kind(rows[group[0]]), *_detail(rows[group[0]])) for group in rest]
    ordered = sorted(range(len(rest)), key=lambda number: (kinds[number], chance[number]))
    have = Counter()
    for number in ordered:
        total = have.total() + len(rest[number])
        best = max(proportions, key=lambda name: proportions[name] * total - have[name])
        have[best] += len(rest[number])
        dealt[best] += rest[number]


def _fill_empty(dealt: dict[str, list[int]], rest: Sequence[Sequence[int]], proportions: Mapping[str, float]) -> None:
    """A part that asks for little gets the smallest group of a part that has several."""
    for name in proportions:
        if dealt[name]:
            continue
        owned = {part: [group for group in rest if group[0] in set(dealt[part])] for part in proportions}
        donors = [(min(groups, key=len), part) for part, groups in owned.items() if len(groups) > 1]
        if donors:
            group, donor = min(donors, key=lambda entry: len(entry[0]))
            gone = set(group)
            dealt[donor] = [place for place in dealt[donor] if place not in gone]
            dealt[name] = list(group)


def _kind(row: Row) -> tuple[str, ...]:
    return row.get("source") or "", row.get("map_set") or ""


def _detail(row: Row) -> tuple[Any, ...]:
    return row.get("pair_id") or "", bool(row.get("success")), base_map(row)
