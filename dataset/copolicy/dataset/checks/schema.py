"""The form of the data: feature table, rate, episode columns and what may stand in them."""

from collections.abc import Iterable, Iterator
from typing import get_args

import numpy as np

from ..episode import EPISODE_COLUMNS, Source, termination_reasons
from ..features import ACTION, HUMAN_ACTION, features_of
from ..lerobot_folder.info import stripped_hint
from ..task_parts import Rule
from .episode_data import EpisodeData
from .finding import Finding

CLOCK_FEATURES: dict[str, dict] = {
    "timestamp": {"dtype": "float32", "shape": (1,), "names": None},
    **{
        name: {"dtype": "int64", "shape": (1,), "names": None}
        for name in ("frame_index", "episode_index", "index", "task_index")
    },
}
"""The features that LeRobot adds to every data set."""


def _format(table: EpisodeData) -> Iterator[Finding]:
    version = str(table.info.get("codebase_version"))
    if not version.startswith("v3."):
        yield Finding("", "schema", version, "v3.x", "error", "another version of LeRobot's format")
    record_hz = table.task.spec.record_hz
    if not table.fps or record_hz % table.fps:
        message = f"the rate is no divisor of {record_hz} Hz"
        yield Finding("", "schema", table.fps, f"a divisor of {record_hz}", "error", message)


def _features(table: EpisodeData) -> Iterator[Finding]:
    features, ours = table.info["features"], features_of(table.task.spec)
    for name, expected in {**ours, **CLOCK_FEATURES}.items():
        entry = features.get(name)
        if entry is None:
            yield Finding("", "schema", None, None, "error", f"no feature {name} in meta/info.json")
            continue
        for part in ("dtype", "shape", "names"):
            found, wanted = entry.get(part), expected[part]
            if part == "shape":
                found, wanted = tuple(entry["shape"]), tuple(wanted)
            if found != wanted and not (part == "names" and wanted is None):
                yield Finding("", "schema", str(found), str(wanted), "error", f"feature {name} with another {part}")
        if not table.files:
            continue  # that no file can be read is said elsewhere, once
        if name not in table.files:
            if name in ours:
                yield Finding("", "schema", None, None, "error", f"no column {name} in the data files")
            continue
        kind, width = {"float32": "float"}.get(expected["dtype"], expected["dtype"]), expected["shape"][0]
        # A list without a fixed size, as some tools write it, is judged by its rows.
        rows = table.frames.get(name)
        found_width = rows.shape[1] if rows is not None and rows.ndim == 2 else table.files[name][1]
        found_kind = str(rows.dtype).replace("float32", "float") if rows is not None else table.files[name][0]
        if (found_kind, found_width) != (kind, width):
            message = f"column {name} of the data files is of another type"
            yield Finding("", "schema", f"{found_kind} x {found_width}", f"{kind} x {width}", "error", message)


def _columns(table: EpisodeData) -> Iterator[Finding]:
    missing = [name for name in EPISODE_COLUMNS if name not in table.columns]
    if missing:
        hint = stripped_hint(table.info, table.root) if "episode_uuid" in missing and table.kind == "lerobot" else ""
        message = f"meta/episodes has no usable columns {', '.join(missing)}{hint}"
        yield Finding("", "schema", len(missing), 0, "error", message)
    reasons = termination_reasons(table.task.spec)
    for name, choices in {"source": get_args(Source), "termination_reason": reasons}.items():
        if name in table.columns:
            values = table.columns[name]
            unknown = ~np.isin(values, choices)
            yield from table.found("schema", unknown, values, "one of the known", f"unknown {name}")
    if "episode_uuid" in table.columns:
        uuids = table.columns["episode_uuid"]
        yield from table.found("schema", uuids == "", uuids, "a name", "no episode_uuid")


def _outcome(table: EpisodeData) -> Iterator[Finding]:
    reasons, successes = table.columns["termination_reason"], table.task.spec.successes
    reached, success = np.isin(reasons, successes), table.columns["success"]
    goal = " or ".join(successes)
    message = f"ended at the {goal} but is no success"
    yield from table.found("outcome", reached & ~success, reasons, "success", message)
    # An episode of the original program may be a success by its own flag; ours end as soon as the goal is touched.
    message = f"a success that did not end at the {goal}"
    yield from table.found("outcome", ~reached & success, reasons, goal, message)


def _outcome_of_frames(table: EpisodeData) -> Iterator[Finding]:
    last = np.zeros(table.frame_count, bool)
    last[table.ends] = True
    for name, expected, message in (
        ("next.done", last, "next.done is not true at the last frame alone"),
        ("next.success", last & np.repeat(table.framed_column("success"), table.counts),
         "next.success contradicts the episode's success"),
    ):  # fmt: skip
        marks = table.count(table.frames[name].reshape(-1).astype(bool) != expected)
        yield from table.found("outcome", marks > 0, marks, 0, message)


def _alignment(table: EpisodeData) -> Iterable[Finding]:
    human, stored = np.split(table.frames[ACTION], 2, axis=1)[1], table.frames[HUMAN_ACTION]
    previous = np.zeros_like(human)
    previous[1:] = human[:-1]
    previous[table.starts] = 0
    off, bound = table.largest(np.abs(stored - previous).max(axis=1)).astype(float), table.limit("previous_action")
    message = f"{HUMAN_ACTION} is not the human action of the frame before"
    return table.found("alignment", ~(off <= bound), off, bound, message)


RULES = (
    Rule("format", "version and rate of a LeRobot data set", _format, kinds=("lerobot",), whole=True),
    Rule("features", "the feature table, in meta/info.json and in the files", _features, kinds=("lerobot",),
         whole=True),
    Rule("columns", "the episode columns and what stands in them", _columns, whole=True),
    Rule("outcome", "success and how the episode ended agree", _outcome, columns=("success", "termination_reason")),
    Rule("outcome_of_frames", "next.done and next.success agree with the episode", _outcome_of_frames,
         ("next.done", "next.success"), ("success",), ("lerobot",)),
    Rule("alignment", "the past human action is the one a frame before", _alignment, (ACTION, HUMAN_ACTION), (),
         ("lerobot",)),
)  # fmt: skip
