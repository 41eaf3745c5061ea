"""Checks that the maps in the rows are those that the episodes name."""

import functools
import math
import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from copolicy.dataset.checks.episode_data import EpisodeData
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.checks.provenance import counts_text
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.lerobot_folder.exclusions import EXCLUDED_PREFIX
from copolicy.dataset.scenarios import DISPLACED
from copolicy.dataset.task_parts import Rule

from ..features import map_from_vector
from ..map_config import MapConfig
from ..maps import MAP_SETS, map_set

_DIFFERENT = float("inf")


def _named(table: EpisodeData) -> Iterator[Finding]:
    columns = (table.columns[name].tolist() for name in ("map_id", "map_set", "map_set_digest"))
    for label, name, group, digest in zip(table.labels, *columns, strict=True):
        family = name.split("-")[0]
        if digest:  # of a map file, whose set name is part of its map names
            if group in MAP_SETS or not name.startswith(f"{group}-"):
                yield Finding(label, "map_name", name, f"{group}-...", "error", "map_set is not the file of map_id")
            continue
        if not name:
            yield Finding(label, "map_name", name, "a map", "warning", "no map_id")
        elif family != "custom" and map_by_name(name) is None:
            yield Finding(label, "map_name", name, "a map of a set", "error", "map_id is not the name of a known map")
        elif group != family and not (group == "paper36" and family == "training"):
            yield Finding(label, "map_name", group, family, "error", "map_set is not the set of map_id")
    flagged = (
        np.char.find(table.columns["quality_flags"], "map_mismatch") >= 0 if "quality_flags" in table.columns else ()
    )
    for index in np.flatnonzero(flagged):
        flags = str(table.columns["quality_flags"][index]).split(",")
        status = "it was recovered" if "map_recovered" in flags else "the one in the rows may be wrong"
        if any(flag.startswith(EXCLUDED_PREFIX) for flag in flags):
            status += "; excluded from training"
        message = f"the importer found another map in the file than was played (map_mismatch): {status}"
        yield Finding(table.labels[index], "map_name", None, None, "warning", message)


def _rows(table: EpisodeData) -> Iterator[Finding]:
    rows = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    bound = table.limit("map_position")
    files: dict[tuple[str, str], MapConfig] = {}
    for index, row in zip(table.framed, rows, strict=True):
        name, digest = (str(table.columns[column][index]) for column in ("map_id", "map_set_digest"))
        expected = None if digest else map_by_name(name)
        if expected is None and not digest:
            continue
        try:
            config = map_from_vector(row, MapConfig.obstacle_size)
        except CopolicyError as error:
            yield Finding(table.labels[index], "map_rows", None, None, "error", str(error))
            continue
        if expected is None:  # the map file may be missing, so the first episode on a map is the reference
            expected = files.setdefault((digest, name), config)
        distance = map_distance(config, expected, start=not name.endswith(DISPLACED))
        if not distance <= bound:
            figure = "other obstacles" if distance == _DIFFERENT else distance
            message = f"start, goal or obstacles in the rows are not those of {name}"
            yield Finding(table.labels[index], "map_rows", figure, bound, "error", message)


def _start(table: EpisodeData) -> Iterator[Finding]:
    first = table.frames[STATE][table.starts].astype(float)
    start = table.frames[ENVIRONMENT_STATE][table.starts].astype(float)
    distance = np.linalg.norm(first[:, :2] - start[:, :2], axis=1)
    bound = table.limit("map_start")
    message = "the episode begins this many px from its map's start"
    yield from table.findings("map_start", ~(distance <= bound), distance, bound, message)


def _obstacle_sizes(table: EpisodeData) -> Iterator[Finding]:
    sizes: dict[str, Counter[str]] = {}
    columns = (table.columns[name].tolist() for name in ("map_set", "map_id", "obstacle_size", "map_set_digest"))
    for label, group, name, size, digest in zip(table.labels, *columns, strict=True):
        if size <= 0 or digest:
            continue  # a data set of an earlier version, or a map of a file, whose obstacles may have different sizes
        sizes.setdefault(group, Counter())[f"of {size} px"] += 1
        expected = map_by_name(name)
        if expected is not None and expected.obstacle_size != size:
            message = f"the obstacles of {name} have another side, px"
            yield Finding(label, "obstacle_size", size, expected.obstacle_size, "error", message)
    for group, counts in sizes.items():
        if len(counts) > 1:
            message = f"obstacles of several sizes in map set {group or 'without a name'}: {counts_text(counts)}"
            yield Finding("", "obstacle_size", len(counts), 1, "warning", message)


def map_distance(config: MapConfig, expected: MapConfig, start: bool = True) -> float:
    """Largest distance between the parts of two maps, px, with sorted obstacles; a turned start counts by the distance
    at the table's end. Infinite where the number of obstacles differs."""
    squares, expected_squares = sorted(config.squares), sorted(expected.squares)
    if len(squares) != len(expected_squares):
        return _DIFFERENT
    distances = [math.dist(config.goal, expected.goal)]
    distances += [math.dist(a, b) for (a, _), (b, _) in zip(squares, expected_squares, strict=True)]
    if start:
        turn = math.remainder(config.start[2] - expected.start[2], 2 * math.pi)
        distances += [math.dist(config.start[:2], expected.start[:2]), 96 * abs(turn)]
    return max(distances)


@functools.cache
def map_by_name(name: str) -> MapConfig | None:
    """The map of a `map_id` by `maps.identify`; None if it is not in a set of the package."""
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
    Rule("obstacle_sizes", "a map set has obstacles of one size, that of its maps", _obstacle_sizes, (),
         ("map_set", "map_id", "obstacle_size", "map_set_digest"), whole=True),
)  # fmt: skip
