"""Rules on duplicate episodes within a data set, and on leakage between training and test data."""

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
class ComparedEpisodes:
    """One side of a leakage comparison: episodes of `data` by their indices, under a name."""

    name: str
    data: EpisodeData
    indices: Sequence[int]


def splits(data: EpisodeData) -> tuple[list[ComparedEpisodes], list[Finding]]:
    """The splits of `meta/info.json` (`"train": "0:40"`), and findings about their ranges."""
    split_episodes: list[ComparedEpisodes] = []
    findings: list[Finding] = []
    entries = data.info.get("splits")
    index_of = {label: index for index, label in enumerate(data.labels)}
    for name, text in (entries if isinstance(entries, dict) else {}).items():
        if (span := split_range(text)) is None:
            findings.append(Finding("", "splits", str(text), "FIRST:END", "error", f"split {name} is not a range"))
            continue
        if span.stop > len(data.labels) or span.start > span.stop:
            message = f"split {name} is not a range within the {len(data.labels)} episodes"
            findings.append(Finding("", "splits", str(text), f"0:{len(data.labels)}", "error", message))
        indices = [index for label, index in index_of.items() if int(label) in span]
        split_episodes.append(ComparedEpisodes(str(name), data, indices))
    for first, second in combinations(split_episodes, 2):
        shared = len(set(first.indices) & set(second.indices))
        if shared:
            message = f"episodes are in both splits, {first.name} and {second.name}"
            findings.append(Finding("", "splits", shared, 0, "error", message))
    return split_episodes, findings


def leaks(first: ComparedEpisodes, second: ComparedEpisodes) -> Iterator[Finding]:
    """Findings for the episodes (by name or bit-identical) and people that two sides share."""
    for key, first_values, second_values in (
        ("episode_uuid", _texts(first, "episode_uuid"), _texts(second, "episode_uuid")),
        ("source_sha256", _texts(first, "source_sha256"), _texts(second, "source_sha256")),
        ("states and actions", _motions(first), _motions(second)),
    ):
        shared = sorted(set(first_values) & set(second_values))
        for value in shared:
            message = f"same {key} as episode {second_values[value]} of {second.name}"
            label = first_values[value] if first.data is second.data else f"{first_values[value]} of {first.name}"
            yield Finding(label, "leakage", 1, 0, "error", message)
    for column in PEOPLE:
        shared = sorted(set(_texts(first, column)) & set(_texts(second, column)))
        if shared:
            # Scripted agents may recur; a person on both sides means that the test does not cover new people.
            severity: Severity = "warning" if _includes_people(first) or _includes_people(second) else "info"
            names = ", ".join(shared[:5]) + (", ..." if len(shared) > 5 else "")
            message = f"the same {column} in {first.name} and {second.name}: {names}"
            yield Finding("", "leakage_people", len(shared), 0, severity, message)


def _between_splits(data: EpisodeData) -> Iterator[Finding]:
    split_episodes, findings = splits(data)
    yield from findings
    for first, second in combinations(split_episodes, 2):
        yield from leaks(first, second)


def _texts(compared: ComparedEpisodes, column: str) -> dict[str, str]:
    if column not in compared.data.columns:
        return {}
    values = compared.data.columns[column]
    return {str(values[index]): compared.data.labels[index] for index in compared.indices if values[index]}


def _motions(compared: ComparedEpisodes) -> dict[str, str]:
    data = compared.data
    if STATE not in data.frames or ACTION not in data.frames or not len(data.starts):
        return {}
    indices = set(compared.indices)
    digests = zip(data.framed.tolist(), motion_digests(data), strict=True)
    return {digest: data.labels[index] for index, digest in digests if index in indices}


def _includes_people(compared: ComparedEpisodes) -> bool:
    sources = compared.data.columns.get("source")
    return sources is None or bool(np.isin(sources[list(compared.indices)], ("human", "upstream")).any())


def motion_digests(data: EpisodeData) -> list[str]:
    """`(F,)` sha256 of each episode's states and actions, in single precision as data sets store them."""
    rows = np.ascontiguousarray(np.hstack((data.frames[STATE], data.frames[ACTION])), np.float32)
    return [
        hashlib.sha256(rows[start : start + count].tobytes()).hexdigest()
        for start, count in zip(data.starts, data.counts, strict=True)
    ]


def _by_column(data: EpisodeData) -> Iterator[Finding]:
    for column, relation in (("episode_uuid", "same episode_uuid as"), ("source_sha256", "same source file as")):
        if column in data.columns:
            yield from _repeated(data.columns[column].tolist(), list(data.labels), relation)


def _by_bits(data: EpisodeData) -> Iterator[Finding]:
    labels = [data.labels[index] for index in data.framed]
    yield from _repeated(motion_digests(data), labels, "states and actions bit-identical to")


def _repeated(values: Iterable[str], labels: list[str], relation: str) -> Iterator[Finding]:
    labels_of: dict[str, list[str]] = defaultdict(list)
    for value, label in zip(values, labels, strict=True):
        if value and labels_of[value]:
            message = f"{relation} episode {labels_of[value][0]}"
            yield Finding(label, "duplicate", len(labels_of[value]) + 1, 1, "error", message)
        labels_of[value].append(label)


DUPLICATE_RULES = (
    Rule("duplicate_names", "every episode_uuid and every source file once", _by_column, (), ("episode_uuid",),
         whole=True),
    Rule("duplicate_motion", "no two episodes with the same states and actions", _by_bits, (STATE, ACTION), whole=True),
)  # fmt: skip

RULES = (
    Rule("leakage", "the splits of meta/info.json share nothing", _between_splits, kinds=("lerobot",), whole=True),
)
