"""Episodes that are there more than once, by name, by file or by their bits."""

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Iterator

import numpy as np

from ..features import ACTION, STATE
from .episode_table import EpisodeTable
from .finding import Finding
from .rule import Rule


def motion_digests(table: EpisodeTable) -> list[str]:
    """`(F,)` sha256 of each episode's states and actions, in single precision as a data set stores them."""
    rows = np.ascontiguousarray(np.hstack((table.frames[STATE], table.frames[ACTION])), np.float32)
    return [
        hashlib.sha256(rows[start : start + count].tobytes()).hexdigest()
        for start, count in zip(table.starts, table.counts, strict=True)
    ]


def _by_column(table: EpisodeTable) -> Iterator[Finding]:
    for column, what in (("episode_uuid", "the same episode_uuid as"), ("source_sha256", "made of the same file as")):
        if column in table.columns:
            yield from _repeated(table.columns[column].tolist(), list(table.labels), what)


def _by_bits(table: EpisodeTable) -> Iterator[Finding]:
    labels = [table.labels[place] for place in table.framed]
    yield from _repeated(motion_digests(table), labels, "the same states and actions, bit for bit, as")


def _repeated(values: Iterable[str], labels: list[str], what: str) -> Iterator[Finding]:
    seen: dict[str, list[str]] = defaultdict(list)
    for value, label in zip(values, labels, strict=True):
        if value and seen[value]:
            message = f"{what} episode {seen[value][0]}"
            yield Finding(label, "duplicate", len(seen[value]) + 1, 1, "error", message)
        seen[value].append(label)


RULES = (
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
