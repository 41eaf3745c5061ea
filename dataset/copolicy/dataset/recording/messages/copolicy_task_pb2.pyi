from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable
from typing import ClassVar as _ClassVar, Optional as _Optional

DESCRIPTOR: _descriptor.FileDescriptor

class State(_message.Message):
    __slots__ = ("step", "sim_time", "values", "monotonic_ns")
    STEP_FIELD_NUMBER: _ClassVar[int]
    SIM_TIME_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    MONOTONIC_NS_FIELD_NUMBER: _ClassVar[int]
    step: int
    sim_time: float
    values: _containers.RepeatedScalarFieldContainer[float]
    monotonic_ns: int
    def __init__(self, step: _Optional[int] = ..., sim_time: _Optional[float] = ..., values: _Optional[_Iterable[float]] = ..., monotonic_ns: _Optional[int] = ...) -> None: ...

class Action(_message.Message):
    __slots__ = ("step", "values")
    STEP_FIELD_NUMBER: _ClassVar[int]
    VALUES_FIELD_NUMBER: _ClassVar[int]
    step: int
    values: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, step: _Optional[int] = ..., values: _Optional[_Iterable[float]] = ...) -> None: ...

class Measures(_message.Message):
    __slots__ = ("step", "reward", "interaction")
    STEP_FIELD_NUMBER: _ClassVar[int]
    REWARD_FIELD_NUMBER: _ClassVar[int]
    INTERACTION_FIELD_NUMBER: _ClassVar[int]
    step: int
    reward: float
    interaction: float
    def __init__(self, step: _Optional[int] = ..., reward: _Optional[float] = ..., interaction: _Optional[float] = ...) -> None: ...
