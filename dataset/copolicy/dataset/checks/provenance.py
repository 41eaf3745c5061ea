"""Rules on the provenance of episodes: consent, licence, and mixed settings, software versions or sources."""

from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from ..exceptions import InvalidValueError
from ..settings_text import UNKNOWN, describe_settings, parse_settings_text
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _physics(data: EpisodeData) -> Iterator[Finding]:
    counts: Counter[str] = Counter()
    for label, text in zip(data.labels, data.columns["physics"].tolist(), strict=True):
        try:
            counts[describe_settings(parse_settings_text(text, data.task), data.task)] += 1
        except InvalidValueError as error:
            yield Finding(label, "physics", None, None, "error", str(error))
    unknown = counts.pop(UNKNOWN, 0)
    if unknown:
        message = "episodes do not state the physics that they were recorded under; exports assume the default"
        yield Finding("", "physics", unknown, 0, "info", message)
    if len(counts) > 1:
        message = f"episodes with different physics, which move differently under equal forces: {counts_text(counts)}"
        yield Finding("", "physics", len(counts), 1, "warning", message)


def _software(data: EpisodeData) -> Iterator[Finding]:
    yield from _mixed_values(data, "software_version", "recorded by several versions of the software")


def _sources(data: EpisodeData) -> Iterator[Finding]:
    yield from _mixed_values(data, "source", "of several sources")


def _mixed_values(data: EpisodeData, column: str, description: str) -> Iterator[Finding]:
    values = data.columns[column]
    counts = Counter(values[np.char.strip(values) != ""].tolist())
    if len(counts) > 1:
        yield Finding("", "mixture", len(counts), 1, "info", f"episodes {description}: {counts_text(counts)}")


def counts_text(counts: Mapping[str, int]) -> str:
    """Counts as text, most frequent first: `3 of 45 px; 1 of 50 px`."""
    ordered = sorted(counts.items(), key=lambda entry: (-entry[1], entry[0]))
    return "; ".join(f"{count} {name}" for name, count in ordered)


def _consent(data: EpisodeData) -> Iterator[Finding]:
    people = data.columns["source"] == "human"
    consent = data.columns["consent_id"]
    missing = people & (np.char.strip(consent) == "")
    message = "people were recorded, but there is no record of their consent"
    yield from data.findings("consent", missing, consent, "a consent_id", message)


def _license(data: EpisodeData) -> Iterator[Finding]:
    licenses = np.char.strip(data.columns["license"])
    missing = int((licenses == "").sum())
    if missing:
        # Recordings get a licence at conversion (--license); a data set must have one.
        severity = "error" if data.kind == "lerobot" else "warning"
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
    Rule("obstacle_sizes", "rule for the size of obstacles"),
    Rule("software", "recorded by one version of the software", _software, (), ("software_version",), whole=True),
    Rule("sources", "episodes of one source", _sources, (), ("source",), whole=True),
)
