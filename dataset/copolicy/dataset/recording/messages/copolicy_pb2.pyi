from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class TableState(_message.Message):
    __slots__ = ("step", "sim_time", "x", "y", "theta", "vx", "vy", "omega", "monotonic_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    THETA_FIELD_NUMBER: _ClassVar[int]
    VX_FIELD_NUMBER: _ClassVar[int]
    VY_FIELD_NUMBER: _ClassVar[int]
    OMEGA_FIELD_NUMBER: _ClassVar[int]
    MONOTONIC_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    sim_time: float
    x: float
    y: float
    theta: float
    vx: float
    vy: float
    omega: float
    monotonic_ns: int
    def __init__(self, step: _Optional[int] = ..., sim_time: _Optional[float] = ..., x: _Optional[float] = ..., y: _Optional[float] = ..., theta: _Optional[float] = ..., vx: _Optional[float] = ..., vy: _Optional[float] = ..., omega: _Optional[float] = ..., monotonic_ns: _Optional[int] = ...) -> None: ...

class PlayerInput(_message.Message):
    __slots__ = ("step", "axes", "buttons", "age_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    AXES_FIELD_NUMBER: _ClassVar[int]
    BUTTONS_FIELD_NUMBER: _ClassVar[int]
    AGE_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    axes: _containers.RepeatedScalarFieldContainer[float]
    buttons: _containers.RepeatedScalarFieldContainer[bool]
    age_ns: int
    def __init__(self, step: _Optional[int] = ..., axes: _Optional[_Iterable[float]] = ..., buttons: _Optional[_Iterable[bool]] = ..., age_ns: _Optional[int] = ...) -> None: ...

class PlayerAction(_message.Message):
    __slots__ = ("step", "fx", "fy")
    STEP_FIELD_NUMBER: _ClassVar[int]
    FX_FIELD_NUMBER: _ClassVar[int]
    FY_FIELD_NUMBER: _ClassVar[int]
    step: int
    fx: float
    fy: float
    def __init__(self, step: _Optional[int] = ..., fx: _Optional[float] = ..., fy: _Optional[float] = ...) -> None: ...

class Interaction(_message.Message):
    __slots__ = ("step", "force", "reward")
    STEP_FIELD_NUMBER: _ClassVar[int]
    FORCE_FIELD_NUMBER: _ClassVar[int]
    REWARD_FIELD_NUMBER: _ClassVar[int]
    step: int
    force: float
    reward: float
    def __init__(self, step: _Optional[int] = ..., force: _Optional[float] = ..., reward: _Optional[float] = ...) -> None: ...

class LoopTiming(_message.Message):
    __slots__ = ("step", "scheduled_ns", "start_ns", "late_ns", "work_ns", "skipped_ticks")
    STEP_FIELD_NUMBER: _ClassVar[int]
    SCHEDULED_NS_FIELD_NUMBER: _ClassVar[int]
    START_NS_FIELD_NUMBER: _ClassVar[int]
    LATE_NS_FIELD_NUMBER: _ClassVar[int]
    WORK_NS_FIELD_NUMBER: _ClassVar[int]
    SKIPPED_TICKS_FIELD_NUMBER: _ClassVar[int]
    step: int
    scheduled_ns: int
    start_ns: int
    late_ns: int
    work_ns: int
    skipped_ticks: int
    def __init__(self, step: _Optional[int] = ..., scheduled_ns: _Optional[int] = ..., start_ns: _Optional[int] = ..., late_ns: _Optional[int] = ..., work_ns: _Optional[int] = ..., skipped_ticks: _Optional[int] = ...) -> None: ...

class EpisodeEvent(_message.Message):
    __slots__ = ("step", "kind", "detail")
    STEP_FIELD_NUMBER: _ClassVar[int]
    KIND_FIELD_NUMBER: _ClassVar[int]
    DETAIL_FIELD_NUMBER: _ClassVar[int]
    step: int
    kind: str
    detail: str
    def __init__(self, step: _Optional[int] = ..., kind: _Optional[str] = ..., detail: _Optional[str] = ...) -> None: ...
