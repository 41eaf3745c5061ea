"""Time alignment of states and actions, for recordings, data sets and execution.

Step k of a recording, at the rate of the task: read the state s_k, choose the action u_k, store (s_k, u_k), advance the
world to s_{k+1}. A data set at `fps` keeps every `stride`-th state; the action of a frame is the mean of its steps,
which best reproduces the motion under a zero-order hold. Execution repeats each action for `stride` steps.
"""

from typing import Literal, get_args

import numpy as np

from .arrays import Array
from .exceptions import InvalidValueError
from .task_spec import RECORD_HZ

Downsampling = Literal["mean", "first"]
"""How the actions between two frames are reduced to one: their mean (reproduces the motion), or the first."""


def stride(fps: int, record_hz: int = RECORD_HZ) -> int:
    """Recorded steps per frame.

    Raises:
        InvalidValueError: `fps` does not divide the recording rate.
    """
    if fps < 1 or record_hz % fps:
        divisors = [d for d in range(1, record_hz + 1) if record_hz % d == 0]
        raise InvalidValueError("fps", f"a divisor of {record_hz} {divisors}", fps)
    return record_hz // fps


def frames(steps: int, fps: int, record_hz: int = RECORD_HZ) -> int:
    """Number of frames of `steps` recorded steps; the last frame may be incomplete."""
    return -(-steps // stride(fps, record_hz))


def frame_states(states: Array, fps: int, record_hz: int = RECORD_HZ) -> Array:
    """States of the frames: `(T, n)` at the recording rate to `(ceil(T / stride), n)`."""
    return states[:: stride(fps, record_hz)]


def frame_actions(actions: Array, fps: int, downsampling: Downsampling = "mean", record_hz: int = RECORD_HZ) -> Array:
    """Actions of the frames: `(T, n)` at the recording rate to `(ceil(T / stride), n)`.

    The dynamics are linear in the force except for clipping, so the mean over a frame's steps reproduces the recorded
    velocity. The last frame may have fewer steps.
    """
    step = stride(fps, record_hz)
    if downsampling not in get_args(Downsampling):
        raise InvalidValueError("downsampling", f"one of {get_args(Downsampling)}", downsampling)
    if downsampling == "first" or step == 1:
        return actions[::step].copy()
    starts = np.arange(0, len(actions), step)
    counts = np.diff(np.append(starts, len(actions)))
    return np.add.reduceat(actions, starts, axis=0) / counts[:, None]


def previous_actions(actions: Array) -> Array:
    """The action of the previous frame, zero at the first: `(T, n)` to `(T, n)`."""
    previous = np.zeros_like(actions)
    previous[1:] = actions[:-1]
    return previous


def zero_order_hold(actions: Array, fps: int) -> Array:
    """Executed actions of an action chunk: `(T, n)` at `fps` to `(T * stride, n)` at the recording rate."""
    return np.repeat(actions, stride(fps), axis=0)
