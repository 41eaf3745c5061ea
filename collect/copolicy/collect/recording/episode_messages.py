"""What a recording says: the metadata at its start and the messages of each step, serialised."""

import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.interaction import interaction_force
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.messages.copolicy_pb2 import (
    EpisodeEvent,
    Interaction,
    LoopTiming,
    PlayerAction,
    PlayerInput,
    TableState,
)
from copolicy.dataset.recording.topics import ACTIONS, EVENT, INPUTS, INTERACTION, LOOP_TIMING, TABLE_STATE, Topic
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.physics import Physics

from .wall_clock import WallClockAnchor

Triple = tuple[float, float, float]
Record = tuple[Topic, bytes]

_PACKAGES = ("mcap", "numpy", "protobuf", "pygame", "pymunk")


def start_records(
    meta: EpisodeMeta, anchor: WallClockAnchor, devices: Mapping[str, str], physics: Physics
) -> dict[str, dict[str, str]]:
    """The metadata records at the start of a recording, by name; no host, user or path is among them."""
    more = {
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
        "physics": episode_records.encode_physics(physics),
        "dataset_info": episode_records.dataset_info(),
    }
    records = {
        name: episode_records.encode(meta, columns) | more.get(name, {})
        for name, columns in episode_records.COLUMNS_AT_START.items()
    }
    records["dataset_info"][episode_records.START_DIGEST] = episode_records.start_digest(records)
    return records


def checked_forces(action: np.ndarray | Sequence[float]) -> tuple[float, ...]:
    """An action `(4,)` as four numbers.

    Raises:
        ShapeError: another shape.
        InvalidValueError: a force that is not in [-1, 1].
    """
    values = np.asarray(action, dtype=float)
    if values.shape != (4,):
        raise ShapeError("action", (4,), values.shape)
    forces = tuple(values.tolist())
    if not all(-1.0 <= force <= 1.0 for force in forces):
        raise InvalidValueError("action", "forces in [-1, 1]", forces)
    return forces


def checked_state(pose: Sequence[float], velocity: Sequence[float]) -> tuple[Triple, Triple]:
    """Pose and velocity as numbers.

    Raises:
        InvalidValueError: a number that is not finite.
    """
    x, y, theta = (float(value) for value in pose)
    vx, vy, omega = (float(value) for value in velocity)
    if not all(map(math.isfinite, (x, y, theta, vx, vy, omega))):
        raise InvalidValueError("state", "finite numbers", (x, y, theta, vx, vy, omega))
    return (x, y, theta), (vx, vy, omega)


def state_record(step: int, pose: Triple, velocity: Triple, monotonic_ns: int) -> Record:
    """The table at the start of a step (px, rad, s)."""
    (x, y, theta), (vx, vy, omega) = pose, velocity
    state = TableState(
        step=step,
        sim_time=step / RECORD_HZ,
        x=x,
        y=y,
        theta=theta,
        vx=vx,
        vy=vy,
        omega=omega,
        monotonic_ns=monotonic_ns,
    )
    return TABLE_STATE, state.SerializeToString()


def action_records(step: int, forces: tuple[float, ...]) -> list[Record]:
    """The forces of a step: robot xy, human xy in [-1, 1]."""
    return [
        (topic, PlayerAction(step=step, fx=fx, fy=fy).SerializeToString())
        for topic, fx, fy in zip(ACTIONS, forces[::2], forces[1::2], strict=True)
    ]


def device_records(
    step: int, inputs: tuple[PlayerInput | None, PlayerInput | None], timing: LoopTiming | None
) -> list[Record]:
    """What devices and loop said in a step, where there are any; fills in their `step`."""
    records = []
    for topic, message in (*zip(INPUTS, inputs, strict=True), (LOOP_TIMING, timing)):
        if message is not None:
            message.step = step
            records.append((topic, message.SerializeToString()))
    return records


def interaction_record(step: int, theta: float, forces: tuple[float, ...], reward: float) -> Record:
    """Interaction force and reward after a step that led to the orientation `theta` (rad)."""
    force = float(interaction_force(theta, np.array(forces)))
    return INTERACTION, Interaction(step=step, force=force, reward=reward).SerializeToString()


def event_record(step: int, kind: str, detail: str) -> Record:
    """Something that happened at a step."""
    return EVENT, EpisodeEvent(step=step, kind=kind, detail=detail).SerializeToString()
