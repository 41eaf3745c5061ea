"""Generic messages for recordings of tasks without message types of their own."""

import functools
import json
from collections.abc import Sequence

import numpy as np

from ..task import PairTask
from ..task_spec import Vector
from .messages.copolicy_task_pb2 import Action, Measures, State
from .task_messages import TaskMessages
from .topics import Topic, player_metadata


class GenericMessages(TaskMessages):
    """Messages of plain numbers; the channel metadata state their names and units."""

    def __init__(self, task: PairTask):
        spec = task.spec
        self._task, self._hz, self._sizes = task, spec.record_hz, (len(spec.recorded), len(spec.action))
        self.state = Topic("/state", State, _meaning(spec.recorded))
        first, second = (
            Topic(f"/player/{player}/action", Action, {**_meaning(spec.action), **player_metadata(player)})
            for player in range(2)
        )
        self.actions = first, second
        self.measures = Topic("/measures", Measures)

    def encode_state(self, step: int, recorded: Sequence[float], monotonic_ns: int) -> bytes:
        sim_time = step / self._hz
        return State(step=step, sim_time=sim_time, values=recorded, monotonic_ns=monotonic_ns).SerializeToString()

    def decode_state(self, payload: bytes) -> tuple[int, Sequence[float]]:
        state = State.FromString(payload)
        return state.step, _sized(state.values, self._sizes[0], "state")

    def encode_action(self, step: int, action: Sequence[float]) -> bytes:
        return Action(step=step, values=action).SerializeToString()

    def decode_action(self, payload: bytes) -> tuple[int, Sequence[float]]:
        action = Action.FromString(payload)
        return action.step, _sized(action.values, self._sizes[1], "action")

    def encode_measures(self, step: int, recorded: Sequence[float], action: Sequence[float], reward: float) -> bytes:
        states = self._task.states_of(np.array([recorded]))
        measured = self._task.interaction(states, np.array([action]))
        interaction = None if measured is None else float(measured[0])
        return Measures(step=step, reward=reward, interaction=interaction).SerializeToString()

    def decode_reward(self, payload: bytes) -> float:
        return Measures.FromString(payload).reward


@functools.cache
def messages_of(task: PairTask) -> TaskMessages:
    """The messages of a task: its own, or the generic ones."""
    return task.recording or GenericMessages(task)


def _meaning(vector: Vector) -> dict[str, str]:
    return {"names": json.dumps(vector.names), "units": json.dumps(vector.units)}


def _sized(values: Sequence[float], size: int, label: str) -> Sequence[float]:
    if len(values) != size:
        raise ValueError(f"a {label} of {len(values)} numbers instead of {size}")
    return values
