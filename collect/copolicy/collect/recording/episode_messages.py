"""Encodes the metadata at the start of a recording and the messages of each step."""

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming, PlayerInput
from copolicy.dataset.recording.topics import EVENT, INPUTS, LOOP_TIMING, Record
from copolicy.dataset.task_spec import TaskSpec

from .wall_clock import WallClockAnchor

_PACKAGES = ("mcap", "numpy", "protobuf", "pygame", "pymunk")


def start_records(
    meta: EpisodeMeta, anchor: WallClockAnchor, devices: Mapping[str, str], settings: Any, spec: TaskSpec
) -> dict[str, dict[str, str]]:
    """The metadata records at the start of a recording, by name; without host, user or paths."""
    other_entries = {
        "session": {
            "started_at": anchor.iso(),
            "wall_ns": str(anchor.wall_ns),
            "monotonic_ns": str(anchor.monotonic_ns),
        },
        "devices": dict(devices),
        "software": {
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
            **{package: version(package) for package in _PACKAGES},
        },
        "physics": episode_records.encode_settings(settings),
        "dataset_info": episode_records.dataset_info(spec),
    }
    records = {
        name: episode_records.encode(meta, columns) | other_entries.get(name, {})
        for name, columns in episode_records.COLUMNS_AT_START.items()
    }
    records["dataset_info"][episode_records.START_DIGEST] = episode_records.start_digest(records)
    return records


def checked_action(action: Array | Sequence[float], spec: TaskSpec) -> tuple[float, ...]:
    """A joint action `(m,)` as a tuple of floats.

    Raises:
        ShapeError: another shape.
        InvalidValueError: a number out of its bounds.
    """
    values, joint = np.asarray(action, dtype=float), spec.joint_action
    if values.shape != (len(joint),):
        raise ShapeError("action", (len(joint),), values.shape)
    low, high = joint.bounds
    numbers = tuple(values.tolist())
    if not ((low <= values) & (values <= high)).all():
        raise InvalidValueError("action", f"numbers in {joint.range}", numbers)
    return numbers


def checked_state(recorded: Sequence[float], spec: TaskSpec) -> tuple[float, ...]:
    """A recorded state `(k,)` as a tuple of floats.

    Raises:
        ShapeError: another length.
        InvalidValueError: a number that is not finite.
    """
    values = np.asarray(recorded, dtype=float)
    if values.shape != (len(spec.recorded),):
        raise ShapeError("state", (len(spec.recorded),), values.shape)
    numbers = tuple(values.tolist())
    if not np.isfinite(values).all():
        raise InvalidValueError("state", "finite numbers", numbers)
    return numbers


def device_records(
    step: int, inputs: tuple[PlayerInput | None, PlayerInput | None], timing: LoopTiming | None
) -> list[Record]:
    """The records of device inputs and loop timing of a step, where present; sets their `step`."""
    records = []
    for topic, message in (*zip(INPUTS, inputs, strict=True), (LOOP_TIMING, timing)):
        if message is not None:
            message.step = step
            records.append((topic, message.SerializeToString()))
    return records


def event_record(step: int, kind: str, detail: str) -> Record:
    """The record of an event at a step."""
    return EVENT, EpisodeEvent(step=step, kind=kind, detail=detail).SerializeToString()
