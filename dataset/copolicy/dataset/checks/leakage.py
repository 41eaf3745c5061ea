"""Episodes that are there twice: in one data set, or in what a policy is trained on and what it is tested on."""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..features import ACTION, STATE
from ..lerobot_folder.info import split_range
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding, Severity

PEOPLE = ("pair_id", "player_0_id", "player_1_id")


@dataclass(frozen=True)
class Part:
    """One side of a comparison: some episodes of a table, by their places."""

    name: str
    table: EpisodeData
    places: Sequence[int]


def splits(table: EpisodeData) -> tuple[list[Part], list[Finding]]:
    """The splits of `meta/info.json` (`"train": "0:40"`), and what is wrong with their ranges."""
    parts: list[Part] = []
    findings: list[Finding] = []
    entries = table.info.get("splits")
    indices = {label: place for place, label in enumerate(table.labels)}
    for name, text in (entries if isinstance(entries, dict) else {}).items():
        if (span := split_range(text)) is None:
            findings.append(Finding("", "splits", str(text), "FIRST:END", "error", f"split {name} is no range"))
            continue
        if span.stop > len(table.labels) or span.start > span.stop:
            message = f"split {name} is not a range of the {len(table.labels)} episodes"
            findings.append(Finding("", "splits", str(text), f"0:{len(table.labels)}", "error", message))
        places = [place for label, place in indices.items() if int(label) in span]
        parts.append(Part(str(name), table, places))
    for one, other in combinations(parts, 2):
        shared = len(set(one.places) & set(other.places))
        if shared:
            message = f"episodes are in both splits, {one.name} and {other.name}"
            findings.append(Finding("", "splits", shared, 0, "error", message))
    return parts, findings


def leaks(one: Part, other: Part) -> Iterator[Finding]:
    """What two parts share: episodes, by name or bit for bit, and people."""
    for what, ours, theirs in (
        ("episode_uuid", _texts(one, "episode_uuid"), _texts(other, "episode_uuid")),
        ("source_sha256", _texts(one, "source_sha256"), _texts(other, "source_sha256")),
        ("states and actions", _motions(one), _motions(other)),
    ):
        shared = sorted(set(ours) & set(theirs))
        for value in shared:
            message = f"same {what} as episode {theirs[value]} of {other.name}"
            label = ours[value] if one.table is other.table else f"{ours[value]} of {one.name}"
            yield Finding(label, "leakage", 1, 0, "error", message)
    for column in PEOPLE:
        shared = sorted(set(_texts(one, column)) & set(_texts(other, column)))
        if shared:
            # Scripted pilots are meant to be met again; a person in both says nothing about new people.
            severity: Severity = "warning" if _people(one) or _people(other) else "info"
            names = ", ".join(shared[:5]) + (", ..." if len(shared) > 5 else "")
            message = f"the same {column} in {one.name} and {other.name}: {names}"
            yield Finding("", "leakage_people", len(shared), 0, severity, message)


def _between_splits(table: EpisodeData) -> Iterator[Finding]:
    parts, findings = splits(table)
    yield from findings
    for one, other in combinations(parts, 2):
        yield from leaks(one, other)


def _texts(part: Part, column: str) -> dict[str, str]:
    if column not in part.table.columns:
        return {}
    values = part.table.columns[column]
    return {str(values[place]): part.table.labels[place] for place in part.places if values[place]}


def _motions(part: Part) -> dict[str, str]:
    table = part.table
    if STATE not in table.frames or ACTION not in table.frames or not len(table.starts):
        return {}
    wanted = set(part.places)
    digests = zip(table.framed.tolist(), motion_digests(table), strict=True)
    return {digest: table.labels[place] for place, digest in digests if place in wanted}


def _people(part: Part) -> bool:
    sources = part.table.columns.get("source")
    return sources is None or bool(np.isin(sources[list(part.places)], ("human", "upstream")).any())


def motion_digests(table: EpisodeData) -> list[str]:
    """`(F,)` sha256 of each episode's states and actions, in single precision as a data set stores them."""
    rows = np.ascontiguousarray(np.hstack((table.frames[STATE], table.frames[ACTION])), np.float32)
    return [
        hashlib.sha256(rows[start : start + count].tobytes()).hexdigest()
        for start, count in zip(table.starts, table.counts, strict=True)
    ]


def _by_column(table: EpisodeData) -> Iterator[Finding]:
    for column, what in (("episode_uuid", "the same episode_uuid as"), ("source_sha256", "made of the same file as")):
        if column in table.columns:
            yield from _repeated(table.columns[column].tolist(), list(table.labels), what)


def _by_bits(table: EpisodeData) -> Iterator[Finding]:
    labels = [table.labels[place] for place in table.framed]
    yield from _repeated(motion_digests(table), labels, "the same states and actions, bit for bit, as")


def _repeated(values: Iterable[str], labels: list[str], what: str) -> Iterator[Finding]:
    seen: dict[str, list[str]] = defaultdict(list)
    for value, label in zip(values, labels, strict=True):
        if value and seen[value]:
            message = f"{what} episode {seen[value][0]}"
            yield Finding(label, "duplicate", len(seen[value]) + 1, 1, "error", message)
        seen[value].append(label)


DUPLICATE_RULES = (
    Rule(
        "duplicate_names",
        "every episode_uuid and every source file once",
        _by_column,
        (),
        ("episode_uuid",),
        whole=True,
    ),
    Rule("duplicate_motion", "no two episodes with the same states and actions", _by_bits, (STATE, ACTION), whole=True),
)


RULES = (
    Rule("leakage", "the splits of meta/info.json share nothing", _between_splits, kinds=("lerobot",), whole=True),
)
