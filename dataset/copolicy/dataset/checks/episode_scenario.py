"""Whether an episode has one scenario throughout, the one that it names, and begins at its start."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from ..exceptions import CopolicyError
from ..features import ENVIRONMENT_STATE, STATE
from ..scenarios import base_name
from ..task import PairTask
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _constant(table: EpisodeData) -> Iterator[Finding]:
    moved, later = table.changes(table.frames[ENVIRONMENT_STATE])
    changed = np.zeros(table.frame_count, int)
    changed[later] = (moved != 0).any(axis=1)
    changes = table.count(changed)
    yield from table.found("map_constant", changes > 0, changes, 0, f"{ENVIRONMENT_STATE} changes within the episode")


def _names(table: EpisodeData) -> Iterator[Finding]:
    columns = (table.columns[name].tolist() for name in ("map_id", "map_set", "map_set_digest"))
    for label, name, group, digest in zip(table.labels, *columns, strict=True):
        known = _named(table.task).get(base_name(name))
        if not name:
            yield Finding(label, "map_name", name, "a map", "warning", "no map_id")
        elif known is None and not digest and not name.startswith("custom-"):
            yield Finding(label, "map_name", name, "a map of a set", "error", "map_id is not the name of a known map")
        elif known is not None and group != known[0]:
            yield Finding(label, "map_name", group, known[0], "error", "map_set is not the set of map_id")


def _files(table: EpisodeData) -> Iterator[Finding]:
    contents: dict[str, Counter[str]] = {}
    columns = (table.columns[name].tolist() for name in ("map_set", "map_set_version", "map_set_digest"))
    for group, version, digest in zip(*columns, strict=True):
        contents.setdefault(group, Counter())[f"version {version or 'none'}, digest {digest or 'none'}"] += 1
    for group, counts in contents.items():
        if len(counts) > 1:
            listed = "; ".join(f"{count} of {text}" for text, count in counts.most_common())
            message = f"episodes of several files of maps that are all named {group}: {listed}"
            yield Finding("", "map_files", len(counts), 1, "warning", message)


def _rows(table: EpisodeData) -> Iterator[Finding]:
    rows, (low, high) = _scenarios(table), table.task.spec.scenario.bounds
    outside = (np.maximum(low - rows, rows - high) / (high - low)).max(axis=1)
    bound = table.limit("map_position")
    yield from table.found(
        "map_rows", ~(outside <= bound), outside, bound, f"{ENVIRONMENT_STATE} is outside its bounds"
    )
    for place, row in zip(table.framed, rows, strict=True):
        name = str(table.columns["map_id"][place])
        _, expected = _named(table.task).get(name, ("", None))
        try:
            table.task.scenario_of_vector(row, {name: values[place] for name, values in table.columns.items()})
        except CopolicyError as error:
            yield Finding(table.labels[place], "map_rows", None, None, "error", str(error))
            continue
        if expected is not None:
            away = float((np.abs(row - table.task.scenario_vector(expected)) / (high - low)).max())
            if not away <= bound:
                message = f"{ENVIRONMENT_STATE} is not that of {name}"
                yield Finding(table.labels[place], "map_rows", away, bound, "error", message)


def _start(table: EpisodeData) -> Iterator[Finding]:
    task, (low, high) = table.task, table.task.spec.state.bounds
    away = np.zeros(len(table.framed))
    for number, (place, row) in enumerate(zip(table.framed, _scenarios(table), strict=True)):
        try:
            columns = {name: values[place] for name, values in table.columns.items()}
            start = task.states_of(np.array([task.start_of(task.scenario_of_vector(row, columns))]))[0]
        except CopolicyError:
            continue  # said by `map_rows`
        away[number] = (np.abs(table.frames[STATE][table.starts[number]] - start) / (high - low)).max()
    yield from table.beyond("map_start", away, "the episode begins this far from its map's start")


def _scenarios(table: EpisodeData) -> np.ndarray:
    return table.frames[ENVIRONMENT_STATE][table.starts].astype(float)


@cache
def _named(task: PairTask) -> Mapping[str, tuple[str, Any]]:
    """Set and scenario by name, of all sets that come with a task."""
    known = [scenario for scenarios in task.scenario_sets.values() for scenario in scenarios]
    return {name: (group, scenario) for scenario in known for name, group in [task.identify(scenario)]}


RULES = (
    Rule("map_constant", "one map an episode", _constant, (ENVIRONMENT_STATE,)),
    Rule("map_names", "map_id and map_set name a known map", _names, (), ("map_id", "map_set", "map_set_digest")),
    Rule("map_files", "maps of one name are of one file", _files, (),
         ("map_set", "map_set_version", "map_set_digest"), whole=True),
    Rule("map_rows", "the scenario of the rows is the named map's", _rows, (ENVIRONMENT_STATE,),
         ("map_id", "map_set_digest")),
    Rule("map_start", "episodes begin at their map's start", _start, (STATE, ENVIRONMENT_STATE)),
)  # fmt: skip
