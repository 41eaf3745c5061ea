"""Rules on the scenario of an episode: constant, the named one, within bounds, and the start state."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from ..arrays import Array
from ..exceptions import CopolicyError
from ..features import ENVIRONMENT_STATE, STATE
from ..scenarios import base_name
from ..task import PairTask
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding


def _constant(data: EpisodeData) -> Iterator[Finding]:
    moved, later = data.changes(data.frames[ENVIRONMENT_STATE])
    changed = np.zeros(data.frame_count, int)
    changed[later] = (moved != 0).any(axis=1)
    changes = data.count(changed)
    yield from data.findings("map_constant", changes > 0, changes, 0, f"{ENVIRONMENT_STATE} changes within the episode")


def _names(data: EpisodeData) -> Iterator[Finding]:
    columns = (data.columns[name].tolist() for name in ("map_id", "map_set", "map_set_digest"))
    for label, name, map_set, digest in zip(data.labels, *columns, strict=True):
        entry = _named(data.task).get(base_name(name))
        if not name:
            yield Finding(label, "map_name", name, "a map", "warning", "no map_id")
        elif entry is None and not digest and not name.startswith("custom-"):
            yield Finding(label, "map_name", name, "a map of a set", "error", "map_id is not the name of a known map")
        elif entry is not None and map_set != entry[0]:
            yield Finding(label, "map_name", map_set, entry[0], "error", "map_set is not the set of map_id")


def _files(data: EpisodeData) -> Iterator[Finding]:
    contents: dict[str, Counter[str]] = {}
    columns = (data.columns[name].tolist() for name in ("map_set", "map_set_version", "map_set_digest"))
    for map_set, version, digest in zip(*columns, strict=True):
        contents.setdefault(map_set, Counter())[f"version {version or 'none'}, digest {digest or 'none'}"] += 1
    for map_set, counts in contents.items():
        if len(counts) > 1:
            listed = "; ".join(f"{count} of {text}" for text, count in counts.most_common())
            message = f"episodes from several map files with the same name {map_set}: {listed}"
            yield Finding("", "map_files", len(counts), 1, "warning", message)


def _rows(data: EpisodeData) -> Iterator[Finding]:
    rows, (low, high) = _scenarios(data), data.task.spec.scenario.bounds
    outside = (np.maximum(low - rows, rows - high) / (high - low)).max(axis=1)
    bound = data.limit("map_position")
    yield from data.findings(
        "map_rows", ~(outside <= bound), outside, bound, f"{ENVIRONMENT_STATE} is outside its bounds"
    )
    for index, row in zip(data.framed, rows, strict=True):
        name = str(data.columns["map_id"][index])
        _, expected = _named(data.task).get(name, ("", None))
        try:
            data.task.scenario_of_vector(row, {name: values[index] for name, values in data.columns.items()})
        except CopolicyError as error:
            yield Finding(data.labels[index], "map_rows", None, None, "error", str(error))
            continue
        if expected is not None:
            distance = float((np.abs(row - data.task.scenario_vector(expected)) / (high - low)).max())
            if not distance <= bound:
                message = f"{ENVIRONMENT_STATE} differs from that of {name}"
                yield Finding(data.labels[index], "map_rows", distance, bound, "error", message)


def _start(data: EpisodeData) -> Iterator[Finding]:
    task, (low, high) = data.task, data.task.spec.state.bounds
    distances = np.zeros(len(data.framed))
    for position, (index, row) in enumerate(zip(data.framed, _scenarios(data), strict=True)):
        try:
            columns = {name: values[index] for name, values in data.columns.items()}
            start = task.states_of(np.array([task.start_of(task.scenario_of_vector(row, columns))]))[0]
        except CopolicyError:
            continue  # a finding of `map_rows`
        distances[position] = (np.abs(data.frames[STATE][data.starts[position]] - start) / (high - low)).max()
    yield from data.over_limit("map_start", distances, "the episode begins at this distance from its map's start")


def _scenarios(data: EpisodeData) -> Array:
    return data.frames[ENVIRONMENT_STATE][data.starts].astype(float)


@cache
def _named(task: PairTask) -> Mapping[str, tuple[str, Any]]:
    """Set and scenario by scenario name, for all sets of a task."""
    scenarios_of_sets = [scenario for scenarios in task.scenario_sets.values() for scenario in scenarios]
    return {name: (map_set, scenario) for scenario in scenarios_of_sets for name, map_set in [task.identify(scenario)]}


RULES = (
    Rule("map_constant", "one map an episode", _constant, (ENVIRONMENT_STATE,)),
    Rule("map_names", "map_id and map_set name a known map", _names, (), ("map_id", "map_set", "map_set_digest")),
    Rule("map_files", "maps of one name are of one file", _files, (),
         ("map_set", "map_set_version", "map_set_digest"), whole=True),
    Rule("map_rows", "the scenario of the rows is the named map's", _rows, (ENVIRONMENT_STATE,),
         ("map_id", "map_set_digest")),
    Rule("map_start", "episodes begin at their map's start", _start, (STATE, ENVIRONMENT_STATE)),
)  # fmt: skip
