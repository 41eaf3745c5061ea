"""A policy as an agent: history of frames, action chunks, zero-order hold, replanning."""

import copy
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, Protocol

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.dataset.task import PairTask, get_task

from ..rollout import Agent, EpisodeStart
from .frame_history import FrameHistory


class Policy(Protocol):
    """A policy for the joint action of both players, as `load_policy` returns it.

    Attributes:
        name: name in recordings.
        task: name of the task that it learned.
        n_obs_steps: frames of history in an observation.
        n_action_steps: actions of a chunk that are executed before the next chunk.
        fps: frames a second of the data that it learned from.
        keeps_history: it stores past frames itself, so it is called for each frame of all worlds; returns one action.
    """

    name: str
    task: str
    n_obs_steps: int
    n_action_steps: int
    fps: int
    keeps_history: bool

    def reset(self, seed: int, /) -> None:
        """Clears the history and seeds the random numbers, before episodes begin."""
        ...

    def predict_action_chunk(self, observations: dict[str, Array], /) -> Array:
        """Joint actions `(B, actions, 2 m)` from the newest frame on, for observations `(B, n_obs_steps, n)`."""
        ...


class _Chunk(NamedTuple):
    frame: int  # of its first action
    worlds: Array  # for which it was predicted
    actions: Array  # (worlds, actions, 2 m)
    observed_ns: int
    seconds: float  # of inference


class PolicyAgent(Agent):
    """Executes its seat's half of a policy's action chunks (receding horizon).

        frame     0     1     2     3     4        of a policy at 10 Hz: three steps each
        observe   o0    o1    o2    o3    o4       state, and the partner's action of the previous frame
        chunk A   a0    a1    a2    ..
        chunk B                     b0    b1       simulated time: predicted after n_action_steps actions of A
        chunk B               (o2)b0 b1   b2       real time: requested one frame earlier, followed once it is ready

    A frame's action is held for record_hz / fps steps, at the rate of the data that the policy learned from. One call
    of the policy predicts the chunks of all worlds.

    In real time inference runs in its own thread; a late action chunk does not block the control loop. The first chunk
    is requested at the start, while the world is at rest. Every step looks for a new chunk and executes it from there
    on, also within a frame, with its action of the present frame; after the last action of a chunk the action is zero.

    A policy acts as the robot. At the human's seat it observes the world with exchanged seats (`PairTask.exchange`); in
    a task without this exchange, the human's half of its joint actions is executed.

    Attributes:
        task: of the worlds.
        latencies: inference time of each chunk since the episodes began, s.
        chunks: `(worlds,)` number of chunks of each world.
    """

    def __init__(
        self,
        policy: Policy,
        task: PairTask | None = None,
        *,
        fps: int | None = None,
        seed: int | None = None,
        real_time: bool = False,
        clock: Callable[[], int] = time.monotonic_ns,
    ):
        """
        Args:
            task: the table if None.
            fps: frames a second; an action is held for one frame. The policy's own rate if None.
            seed: of the policy's random numbers; that of the first world if None.
            real_time: run inference in its own thread.
            clock: monotonic time, ns.

        Raises:
            InvalidValueError: the policy learned another task.
        """
        self.name: str = policy.name
        self.latencies: list[float] = []
        self._policy = policy
        self.task: PairTask = task or get_task()
        if policy.task != self.task.spec.name:
            expected = f"a policy that has learned the task {self.task.spec.name!r}"
            raise InvalidValueError(policy.name, expected, policy.task)
        self._fps, self._seed, self._clock = fps, seed, clock
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="policy") if real_time else None
        self._reset: Future[None]
        self._pending: Future[_Chunk] | None = None
        self._chunk: _Chunk | None = None

    def begin(self, seat: int, starts: Sequence[EpisodeStart]) -> None:
        """Clears the history; in real time, requests the first chunk."""
        if self._pending is not None:
            self._pending.cancel()
        self._pending, self._chunk = None, None
        self.latencies = []
        # The policy may have been replaced since the last episode, so its rate is read here.
        self._seat, spec = seat, self.task.spec
        count, self._size = len(starts), len(spec.action)
        self._history = FrameHistory(self.task, seat, starts, self._policy.n_obs_steps, self._fps or self._policy.fps)
        self._bounds = spec.joint_action.bounds
        self._joint = np.zeros((count, 2 * self._size))  # of the present frame
        self._observed_ns = 0  # of the present chunk; 0 without one
        self.chunks: Array = np.zeros(count, int)
        self._step = 0
        seed = starts[0].seed if self._seed is None else self._seed
        if self._worker is None:
            self._policy.reset(seed)
        else:
            self._reset = self._worker.submit(self._policy.reset, seed)  # after the inference that still runs
            self._request_chunk(0, np.arange(count))

    def act(self, states: Array, worlds: Array) -> Array:
        """Its half of the joint actions of the present frame."""
        frame, step_in_frame = divmod(self._step, self._history.stride)
        if step_in_frame == 0:
            if frame > 0:
                self._history.observe(states, worlds)
            self._next_action(frame, worlds)
        elif self._accept_pending(frame):
            self._execute(frame)
        actions = self.half(self._seat, worlds)
        if self._worker is not None:
            age = self._clock() - self._observed_ns if self._observed_ns else 0
            self.input: PlayerInput | None = PlayerInput(axes=actions[0].tolist(), age_ns=age)
        return actions

    def half(self, seat: int, worlds: Array) -> Array:
        """A seat's half `(B, m)` of the joint actions of the present frame."""
        return self._joint[worlds, seat * self._size : (seat + 1) * self._size]

    def acted(self, actions: Array, worlds: Array) -> None:
        """Adds the joint actions to the history."""
        self._history.acted(actions, worlds)
        self._step += 1

    def human_half(self) -> Agent:
        """An agent for the human's seat that executes the human's half of the same chunks, as in co-planning."""
        return _HumanHalf(self)

    def branch(self, count: int) -> "PolicyAgent":
        """A copy of this agent of one world for `count` copies of that world; it predicts a new chunk in each."""
        branch = copy.copy(self)
        branch._history = self._history.repeated(count)
        for name in ("_joint", "chunks"):
            setattr(branch, name, np.repeat(getattr(self, name), count, axis=0))
        branch._chunk = None
        return branch

    @property
    def predicted(self) -> Array:
        """`(worlds, actions, 2 m)` the present chunks."""
        assert self._chunk is not None, "a chunk before the first step"
        return self._chunk.actions

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits for the pending chunk, if there is one."""
        if self._pending is not None:
            self._pending.result(timeout_s)

    def close(self) -> None:
        """Ends the inference thread after the chunk that it predicts."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)

    def _next_action(self, frame: int, worlds: Array) -> None:
        self._accept_pending(frame)
        ahead = int(self._worker is not None)
        if self._pending is None:
            chunk = self._chunk
            if chunk is None or frame - chunk.frame + ahead >= min(self._policy.n_action_steps, chunk.actions.shape[1]):
                # In real time a single action is ready one frame later.
                self._request_chunk(frame + ahead * self._policy.keeps_history, worlds)
        self._execute(frame)

    def _accept_pending(self, frame: int) -> bool:
        """Takes the requested chunk if it is ready and its first action is due; returns whether it did."""
        if self._pending is None or not self._pending.done():
            return False
        self._reset.result()  # done before the chunk; raises its error
        if self._pending.result().frame > frame:
            return False
        self._accept_chunk(self._pending.result())
        return True

    def _execute(self, frame: int) -> None:
        """Sets the joint actions to those of the present chunk for a frame."""
        chunk = self._chunk
        if chunk is None or frame - chunk.frame >= chunk.actions.shape[1]:
            self._joint, self._observed_ns = np.zeros_like(self._joint), 0
            return
        exchange = self._history.exchange
        joint = np.clip(chunk.actions[:, frame - chunk.frame], *self._bounds)
        self._joint = joint if exchange is None else exchange.actions(joint)
        self._observed_ns = chunk.observed_ns

    def _request_chunk(self, frame: int, worlds: Array) -> None:
        if self._policy.keeps_history:
            worlds = np.arange(len(self._history))
        request = (frame, worlds, self._history.observations(worlds), self._clock())
        if self._worker is None:
            self._accept_chunk(self._predict(*request))
        else:
            self._pending = self._worker.submit(self._predict, *request)

    def _predict(self, frame: int, worlds: Array, observations: dict[str, Array], observed_ns: int) -> _Chunk:
        started = time.perf_counter()
        predicted = self._policy.predict_action_chunk(observations)
        seconds = time.perf_counter() - started
        actions = np.zeros((len(self._history), *predicted.shape[1:]))
        actions[worlds] = predicted
        return _Chunk(frame, worlds, actions, observed_ns, seconds)

    def _accept_chunk(self, chunk: _Chunk) -> None:
        self._chunk, self._pending = chunk, None
        self.chunks[chunk.worlds] += 1
        self.latencies.append(chunk.seconds)


class _HumanHalf(Agent):
    def __init__(self, agent: PolicyAgent):
        self.name = agent.name
        self._agent = agent

    def act(self, states: Array, worlds: Array) -> Array:
        return self._agent.half(1, worlds)
