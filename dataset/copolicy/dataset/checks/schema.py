"""Rules on the schema: format version, rate, features, episode columns and their values, outcomes."""

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


def _format(data: EpisodeData) -> Iterator[Finding]:
    version = str(data.info.get("codebase_version"))
    if not version.startswith("v3."):
        yield Finding("", "schema", version, "v3.x", "error", "another version of LeRobot's format")
    record_hz = data.task.spec.record_hz
    if not data.fps or record_hz % data.fps:
        message = f"the rate is no divisor of {record_hz} Hz"
        yield Finding("", "schema", data.fps, f"a divisor of {record_hz}", "error", message)


def _features(data: EpisodeData) -> Iterator[Finding]:
    features, task_features = data.info["features"], features_of(data.task.spec)
    for name, expected in {**task_features, **CLOCK_FEATURES}.items():
        entry = features.get(name)
        if entry is None:
            yield Finding("", "schema", None, None, "error", f"no feature {name} in meta/info.json")
            continue
        for key in ("dtype", "shape", "names"):
            actual, target = entry.get(key), expected[key]
            if key == "shape":
                actual, target = tuple(entry["shape"]), tuple(target)
            if actual != target and not (key == "names" and target is None):
                yield Finding("", "schema", str(actual), str(target), "error", f"feature {name} with another {key}")
        if not data.files:
            continue  # unreadable files are findings of `reading`
        if name not in data.files:
            if name in task_features:
                yield Finding("", "schema", None, None, "error", f"no column {name} in the data files")
            continue
        dtype, width = {"float32": "float"}.get(expected["dtype"], expected["dtype"]), expected["shape"][0]
        # For a list of variable size, as some tools write, the rows decide.
        rows = data.frames.get(name)
        actual_width = rows.shape[1] if rows is not None and rows.ndim == 2 else data.files[name][1]
        actual_dtype = str(rows.dtype).replace("float32", "float") if rows is not None else data.files[name][0]
        if (actual_dtype, actual_width) != (dtype, width):
            message = f"column {name} of the data files has the wrong type"
            yield Finding("", "schema", f"{actual_dtype} x {actual_width}", f"{dtype} x {width}", "error", message)


def _columns(data: EpisodeData) -> Iterator[Finding]:
    missing = [name for name in EPISODE_COLUMNS if name not in data.columns]
    if missing:
        hint = stripped_hint(data.info, data.root) if "episode_uuid" in missing and data.kind == "lerobot" else ""
        message = f"meta/episodes has no usable columns {', '.join(missing)}{hint}"
        yield Finding("", "schema", len(missing), 0, "error", message)
    reasons = termination_reasons(data.task.spec)
    for name, choices in {"source": get_args(Source), "termination_reason": reasons}.items():
        if name in data.columns:
            values = data.columns[name]
            unknown = ~np.isin(values, choices)
            yield from data.findings("schema", unknown, values, "one of the known", f"unknown {name}")
    if "episode_uuid" in data.columns:
        uuids = data.columns["episode_uuid"]
        yield from data.findings("schema", uuids == "", uuids, "a name", "no episode_uuid")


def _outcome(data: EpisodeData) -> Iterator[Finding]:
    reasons, successes = data.columns["termination_reason"], data.task.spec.successes
    reached, success = np.isin(reasons, successes), data.columns["success"]
    goal = " or ".join(successes)
    message = f"ended at the {goal} but is not a success"
    yield from data.findings("outcome", reached & ~success, reasons, "success", message)
    # The original program may flag a success elsewhere; our episodes end as soon as the goal is touched.
    message = f"a success that did not end at the {goal}"
    yield from data.findings("outcome", ~reached & success, reasons, goal, message)


def _outcome_of_frames(data: EpisodeData) -> Iterator[Finding]:
    last = np.zeros(data.frame_count, bool)
    last[data.ends] = True
    for name, expected, message in (
        ("next.done", last, "next.done is not true at the last frame alone"),
        ("next.success", last & np.repeat(data.framed_column("success"), data.counts),
         "next.success contradicts the episode's success"),
    ):  # fmt: skip
        marks = data.count(data.frames[name].reshape(-1).astype(bool) != expected)
        yield from data.findings("outcome", marks > 0, marks, 0, message)


def _alignment(data: EpisodeData) -> Iterable[Finding]:
    human, stored = np.split(data.frames[ACTION], 2, axis=1)[1], data.frames[HUMAN_ACTION]
    previous = np.zeros_like(human)
    previous[1:] = human[:-1]
    previous[data.starts] = 0
    errors, bound = data.maximum(np.abs(stored - previous).max(axis=1)).astype(float), data.limit("previous_action")
    message = f"{HUMAN_ACTION} is not the human action of the previous frame"
    return data.findings("alignment", ~(errors <= bound), errors, bound, message)


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
