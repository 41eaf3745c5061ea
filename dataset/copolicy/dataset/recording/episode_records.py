"""Encodes the episode columns as metadata records of a recording, and decodes them."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, get_args

from ..episode import EPISODE_COLUMNS, SET_COLUMNS, UNKNOWN_VALUES, EpisodeMeta, Source, termination_reasons
from ..exceptions import InvalidValueError
from ..task import PairTask
from ..task_spec import TaskSpec

SCHEMA_VERSION = "1"
"""Schema version of recordings; readers refuse unknown versions."""

COLUMNS_AT_START: dict[str, tuple[str, ...]] = {
    "session": ("session_id",),
    "episode": ("episode_uuid", "map_id", "map_set", "seed", "source", *SET_COLUMNS),
    "players": ("pair_id", "player_0_id", "player_1_id", "controller_0", "controller_1"),
    "devices": (),
    "software": ("software_version",),
    "consent": ("consent_id", "license"),
    "physics": (),
    "dataset_info": (),
}
"""The metadata records at the start of a recording, each with its episode columns.

The columns in `SET_COLUMNS` are written only for maps from a file.
"""

RESULT = "episode_result"
COLUMNS_AT_END = (
    "success",
    "termination_reason",
    "duration_s",
    "achieved_hz",
    "late_ticks",
    "route_class",
    "quality_flags",
    "discarded",
)
"""The episode columns of the record `episode_result` at the end of a recording."""

START_DIGEST = "start_sha256"
"""The entry of the record `dataset_info` with the digest of all records at the start (`start_digest`)."""

TASK, TASK_SPEC = "task", "task_spec"
"""The entries of the record `dataset_info` with name and spec of the task; without them it is the table task."""


def dataset_info(spec: TaskSpec) -> dict[str, str]:
    """The record `dataset_info`: rate, names and units of the vectors, alignment, and the spec of the task."""
    return {
        "schema_version": SCHEMA_VERSION,
        "fps": str(spec.record_hz),
        "state_names": json.dumps(spec.state.names),
        "state_units": ", ".join(spec.state.units),
        "action_names": json.dumps(spec.joint_action.names),
        "action_units": f"{', '.join(dict.fromkeys(spec.action.units))}, {spec.action.range}",
        "alignment": "the action of step k was taken in the state of step k; one more state follows the last action",
        TASK: spec.name,
        TASK_SPEC: json.dumps(spec.to_dict(), sort_keys=True),
    }


def encode_settings(settings: Any) -> dict[str, str]:
    """The record `physics`: every world setting as exact decimal text."""
    return {name: repr(value) for name, value in asdict(settings).items()}


def decode_settings(records: Mapping[str, Mapping[str, str]], task: PairTask) -> Any:
    """World settings from the metadata records, the inverse of `encode_settings`.

    Raises:
        InvalidValueError: a setting is missing or not a number.
    """
    return task.settings_of(records.get("physics", {}), "metadata record 'physics', entry '{}'")


def start_digest(records: Mapping[str, Mapping[str, str]]) -> str:
    """sha256 of the metadata records at the start, without the digest itself.

    It verifies the metadata of an unfinished recording, which lacks the check sum at the end of the file.
    """
    start = {
        record: {name: text for name, text in records[record].items() if name != START_DIGEST}
        for record in COLUMNS_AT_START
        if record in records
    }
    return hashlib.sha256(json.dumps(start, sort_keys=True).encode()).hexdigest()


def encode(meta: EpisodeMeta, columns: tuple[str, ...]) -> dict[str, str]:
    """Columns as text: `true` and `false` for a bool, the shortest exact digits for a float."""
    values = {name: getattr(meta, name) for name in columns}
    names = (name for name in columns if name not in SET_COLUMNS or values[name] != UNKNOWN_VALUES[name])
    return {name: _encode(values[name]) for name in names}


def decode(records: Mapping[str, Mapping[str, str]], spec: TaskSpec) -> EpisodeMeta:
    """Episode metadata from the metadata records, the inverse of `encode`.

    Raises:
        InvalidValueError: a record or an entry is missing, or has the wrong type.
    """
    columns: dict[str, Any] = {}
    for record, names in {**COLUMNS_AT_START, RESULT: COLUMNS_AT_END}.items():
        if record not in records:
            raise InvalidValueError("metadata", f"a record {record!r}", sorted(records))
        for name in names:
            if name not in records[record]:
                if name in SET_COLUMNS:
                    continue
                raise InvalidValueError(f"metadata record {record!r}", f"an entry {name!r}", sorted(records[record]))
            columns[name] = _decode(name, records[record][name], spec)
    version = records["dataset_info"].get("schema_version")
    if version != SCHEMA_VERSION:
        raise InvalidValueError("schema_version", SCHEMA_VERSION, version)
    return EpisodeMeta(**columns)


def _encode(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, float) else str(value)


def _decode(name: str, text: str, spec: TaskSpec) -> object:
    type_name = EPISODE_COLUMNS[name]
    try:
        if type_name == "bool":
            return {"true": True, "false": False}[text]
        if type_name == "int":
            return int(text)
        if type_name == "float":
            number = float(text)
            if math.isinf(number):
                raise ValueError
            return number
    except (KeyError, ValueError):
        raise InvalidValueError(f"metadata entry {name!r}", type_name, text) from None
    choices = {"source": get_args(Source), "termination_reason": termination_reasons(spec)}.get(name)
    if choices and text not in choices:
        raise InvalidValueError(f"metadata entry {name!r}", f"one of {choices}", text)
    return text
