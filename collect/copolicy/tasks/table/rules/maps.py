"""Whether the maps that the episodes name are the ones in their rows."""

import functools
import math
import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from copolicy.dataset.checks.episode_table import EpisodeTable
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.checks.mixtures import listed
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.scenarios import DISPLACED
from copolicy.dataset.task_parts import Rule

from ..features import map_of
from ..map_config import MapConfig
from ..maps import MAP_SETS, map_set

_UNLIKE = float("inf")


def _named(table: EpisodeTable) -> Iterator[Finding]:
    columns = (table.columns[name].tolist() for name in ("map_id", "map_set", "map_set_digest"))
    for label, name, group, digest in zip(table.labels, *columns, strict=True):
        family = name.split("-")[0]
        if digest:  # of a file, whose maps bear its name
            if group in MAP_SETS or not name.startswith(f"{group}-"):
                yield Finding(label, "map_name", name, f"{group}-...", "error", "map_set is not the file of map_id")
            continue
        if not name:
            yield Finding(label, "map_name", name, "a map", "warning", "no map_id")
        elif family != "custom" and named_map(name) is None:
            yield Finding(label, "map_name", name, "a map of a set", "error", "map_id is not the name of a known map")
        elif group != family and not (group == "paper36" and family == "training"):
            yield Finding(label, "map_name", group, family, "error", "map_set is not the set of map_id")
    flagged = (
        np.char.find(table.columns["quality_flags"], "map_mismatch") >= 0 if "quality_flags" in table.columns else ()
    )
    for place in np.flatnonzero(flagged):
        flags = str(table.columns["quality_flags"][place]).split(",")
        then = "it was recovered" if "map_recovered" in flags else "the one in the rows may be wrong"
        if any(flag.startswith(EXCLUDED_PREFIX) for flag in flags):
            then += "; excluded from training"
        message = f"the importer found another map in the file than was played (map_mismatch): {then}"
        yield Finding(table.labels[place], "map_name", None, None, "warning", message)


def _rows(table: EpisodeTable) -> Iterator[Finding]:
    rows = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    bound = table.limit("map_position")
    files: dict[tuple[str, str], MapConfig] = {}
    for place, row in zip(table.framed, rows, strict=True):
        name, digest = (str(table.columns[column][place]) for column in ("map_id", "map_set_digest"))
        expected = None if digest else named_map(name)
        if expected is None and not digest:
            continue
        try:
            found = map_of(row, MapConfig.obstacle_size)
        except CopolicyError as error:
            yield Finding(table.labels[place], "map_rows", None, None, "error", str(error))
            continue
        if expected is None:  # the file is not here: the first episode on a map says what it is
            expected = files.setdefault((digest, name), found)
        distance = map_distance(found, expected, start=not name.endswith(DISPLACED))
        if not distance <= bound:
            figure = "other obstacles" if distance == _UNLIKE else distance
            message = f"start, goal or obstacles in the rows are not those of {name}"
            yield Finding(table.labels[place], "map_rows", figure, bound, "error", message)


def _start(table: EpisodeTable) -> Iterator[Finding]:
    first = table.frames[STATE][table.starts].astype(float)
    start = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    away = np.linalg.norm(first[:, :2] - start[:, :2], axis=1)
    bound = table.limit("map_start")
    message = "the episode begins this many px from its map's start"
    yield from table.found("map_start", ~(away <= bound), away, bound, message)


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
            message = f"obstacles of several sizes in map set {group or 'without a name'}: {listed(counts)}"
            yield Finding("", "obstacle_size", len(counts), 1, "warning", message)


def map_distance(found: MapConfig, expected: MapConfig, start: bool = True) -> float:
    """Largest distance in px between the parts of two maps, whatever the order of their obstacles; a turned start
    counts with the way of the table's end. Infinite where the number of obstacles differs."""
    own, other = sorted(found.squares), sorted(expected.squares)
    if len(own) != len(other):
        return _UNLIKE
    ends = [(found.goal, expected.goal), *((a, b) for (a, _), (b, _) in zip(own, other, strict=True))]
    distances = [math.dist(one, other) for one, other in ends]
    if start:
        turn = math.remainder(found.start[2] - expected.start[2], 2 * math.pi)
        distances += [math.dist(found.start[:2], expected.start[:2]), 96 * abs(turn)]
    return max(distances)


@functools.cache
def named_map(name: str) -> MapConfig | None:
    """The map behind a `map_id`, by the names that `task.identify` gives; None if it is of no set."""
    match = re.fullmatch(r"([a-z0-9]+)-(\d+)(?:-(\d+)deg)?", name.removesuffix(DISPLACED))
    if match is None or match[1] not in MAP_SETS or int(match[2]) >= len(MAP_SETS[match[1]]):
        return None
    if match[3] is None:
        return MAP_SETS[match[1]][int(match[2])]
    turned = map_set(match[1], orientations=True)[4 * int(match[2]) : 4 * int(match[2]) + 4]
    return next((config for config in turned if round(math.degrees(config.start[2])) == int(match[3])), None)


RULES = (
    Rule("map_names", "map_id and map_set name a known map", _named, (), ("map_id", "map_set", "map_set_digest")),
    Rule("map_rows", "start, goal and obstacles of the rows are the named map's", _rows, (ENVIRONMENT_STATE,),
         ("map_id", "map_set_digest")),
    Rule("map_start", "episodes begin at their map's start", _start, (STATE, ENVIRONMENT_STATE)),
    Rule("obstacle_sizes", "obstacles of one size in a map set, the size of its maps", _obstacle_sizes, (),
         ("map_set", "map_id", "obstacle_size", "map_set_digest"), whole=True),
)  # fmt: skip
