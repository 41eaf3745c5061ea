"""Whether a data set mixes episodes of different physics, obstacle sizes, software versions or sources."""

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from ..exceptions import InvalidValueError
from ..physics_text import UNKNOWN, physics_of, physics_summary
from .episode_table import EpisodeTable
from .finding import Finding
from .maps import named_map
from .rule import Rule


def _physics(table: EpisodeTable) -> Iterator[Finding]:
    counts: Counter[str] = Counter()
    for label, text in zip(table.labels, table.columns["physics"].tolist(), strict=True):
        try:
            counts[physics_summary(physics_of(text, table.task), table.task)] += 1
        except InvalidValueError as error:
            yield Finding(label, "physics", None, None, "error", str(error))
    unknown = counts.pop(UNKNOWN, 0)
    if unknown:
        message = "episodes do not say under which physics they were recorded; exports go on under the default"
        yield Finding("", "physics", unknown, 0, "info", message)
    if len(counts) > 1:
        message = f"episodes of several physics, which move otherwise under the same forces: {_listed(counts)}"
        yield Finding("", "physics", len(counts), 1, "warning", message)


def _obstacle_sizes(table: EpisodeTable) -> Iterator[Finding]:
    sizes: dict[str, Counter[str]] = {}
    columns = (table.columns[name].tolist() for name in ("map_set", "map_id", "obstacle_size"))
    for label, group, name, size in zip(table.labels, *columns, strict=True):
        if size <= 0:
            continue  # a data set of an earlier version
        sizes.setdefault(group, Counter())[f"of {size} px"] += 1
        expected = named_map(name)
        if expected is not None and expected.obstacle_size != size:
            message = f"the obstacles of {name} have another side, px"
            yield Finding(label, "obstacle_size", size, expected.obstacle_size, "error", message)
    for group, counts in sizes.items():
        if len(counts) > 1:
            message = f"obstacles of several sizes in map set {group or 'without a name'}: {_listed(counts)}"
            yield Finding("", "obstacle_size", len(counts), 1, "warning", message)


def _software(table: EpisodeTable) -> Iterator[Finding]:
    yield from _several(table, "software_version", "recorded by several versions of the software")


def _sources(table: EpisodeTable) -> Iterator[Finding]:
    yield from _several(table, "source", "of several sources")


def _several(table: EpisodeTable, column: str, what: str) -> Iterator[Finding]:
    values = table.columns[column]
    counts = Counter(values[np.char.strip(values) != ""].tolist())
    if len(counts) > 1:
        yield Finding("", "mixture", len(counts), 1, "info", f"episodes {what}: {_listed(counts)}")


def _listed(counts: Mapping[str, int]) -> str:
    ordered = sorted(counts.items(), key=lambda entry: (-entry[1], entry[0]))
    return "; ".join(f"{count} {name}" for name, count in ordered)


RULES = (
    Rule("physics", "all episodes were recorded under one physics", _physics, (), ("physics",), whole=True),
    Rule("obstacle_sizes", "obstacles of one size in a map set, the size of its maps", _obstacle_sizes, (),
         ("map_set", "map_id", "obstacle_size"), whole=True),
    Rule("software", "recorded by one version of the software", _software, (), ("software_version",), whole=True),
    Rule("sources", "episodes of one source", _sources, (), ("source",), whole=True),
)  # fmt: skip
