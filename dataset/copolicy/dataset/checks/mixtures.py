"""What the episodes say of themselves: consent, licence, and mixtures of physics, obstacle sizes, software, sources."""

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from ..exceptions import InvalidValueError
from ..physics_text import UNKNOWN, physics_of, physics_summary
from .episode_table import EpisodeTable
from .finding import Finding
from .maps import named_map
from .rule import Rule, each


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
    columns = (table.columns[name].tolist() for name in ("map_set", "map_id", "obstacle_size", "map_set_digest"))
    for label, group, name, size, digest in zip(table.labels, *columns, strict=True):
        if size <= 0 or digest:
            continue  # a data set of an earlier version; a map of a file, where each obstacle has a size of its own
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


def _consent(table: EpisodeTable) -> Iterator[Finding]:
    people = table.columns["source"] == "human"
    consent = table.columns["consent_id"]
    missing = people & (np.char.strip(consent) == "")
    message = "people were recorded, but there is no record of their consent"
    yield from each(table, missing, "consent", consent, "a consent_id", "error", message)


def _license(table: EpisodeTable) -> Iterator[Finding]:
    licenses = np.char.strip(table.columns["license"])
    missing = int((licenses == "").sum())
    if missing:
        # Recordings get theirs when they are converted (--license); what others load must have one.
        severity = "error" if table.kind == "lerobot" else "warning"
        message = f"of {len(licenses)} episodes state no licence; nobody may use them"
        yield Finding("", "license", missing, 0, severity, message)
    several = sorted(set(licenses.tolist()) - {""})
    if len(several) > 1:
        message = f"several licences in one data set: {', '.join(several)}"
        yield Finding("", "license", len(several), 1, "warning", message)


CONSENT_RULES = (
    Rule("consent", "people agreed to be recorded", _consent, (), ("source", "consent_id")),
    Rule("license", "every episode states one licence", _license, (), ("license",), whole=True),
)


RULES = (
    Rule("physics", "all episodes were recorded under one physics", _physics, (), ("physics",), whole=True),
    Rule("obstacle_sizes", "obstacles of one size in a map set, the size of its maps", _obstacle_sizes, (),
         ("map_set", "map_id", "obstacle_size", "map_set_digest"), whole=True),
    Rule("software", "recorded by one version of the software", _software, (), ("software_version",), whole=True),
    Rule("sources", "episodes of one source", _sources, (), ("source",), whole=True),
)  # fmt: skip
