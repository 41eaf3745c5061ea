"""Whether people agreed, and under which licence the data may be used."""

from collections.abc import Iterator

import numpy as np

from .episode_table import EpisodeTable
from .finding import Finding
from .rule import Rule, each


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


RULES = (
    Rule("consent", "people agreed to be recorded", _consent, (), ("source", "consent_id")),
    Rule("license", "every episode states one licence", _license, (), ("license",), whole=True),
)
