"""Tables of sound episodes with one thing changed, and what a rule finds in them."""

from dataclasses import replace

import numpy as np

from copolicy.dataset.checks.checking import rules_of
from copolicy.dataset.checks.episode_data import EpisodeData
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.task import get_task

BY_NAME = {rule.name: rule for rule in rules_of(get_task())}


def find(table: EpisodeData, rule: str) -> list[Finding]:
    search = BY_NAME[rule].find
    assert search is not None
    return list(search(table))


def of(findings: list[Finding]) -> list[tuple[str, str]]:
    return [(finding.episode, finding.severity) for finding in findings]


def with_frames(table: EpisodeData, name: str, change) -> EpisodeData:
    values = table.frames[name].copy()
    change(values)
    return replace(table, frames={**table.frames, name: values})


def with_column(table: EpisodeData, name: str, values) -> EpisodeData:
    return replace(table, columns={**table.columns, name: np.array(values)})


def with_entry(table: EpisodeData, name: str, place: int, value) -> EpisodeData:
    return with_column(table, name, [*table.columns[name][:place], value, *table.columns[name][place + 1 :]])


def all_frames(table: EpisodeData, episode: int) -> slice:
    return slice(table.starts[episode], table.ends[episode] + 1)
