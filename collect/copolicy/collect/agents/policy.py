"""A policy at the stick: plans on a thread beside the loop, executed on the policy's own grid of frames."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import NamedTuple, Protocol

import numpy as np

from copolicy.dataset.clock import frame_actions, stride
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.recording.messages.copolicy_pb2 import PlayerInput
from copolicy.tasks.table.features import environment_state, state_vector
from copolicy.tasks.table.map_config import MapConfig

from .controller import ZERO, Reading


class JointPlanner(Protocol):
    """What `Checkpoint` offers."""

    name: str
    frames: int
    actions_per_plan: int

    @property
    def fps(self) -> int:
        """Frames a second that plans are for."""
        ...

    def seed(self, seed: int) -> None:
        """Sets the source of noise."""
        ...

    def plan(self, history: dict[str, np.ndarray]) -> np.ndarray:
        """`(frames, 4)` joint actions from the newest frame on."""
        ...


class _Plan(NamedTuple):
    frame: int  # that its first action is for
    actions: np.ndarray
    observed_ns: int
    seconds: float


class PolicyController:
    """Executes its seat's half of a policy's joint plans (receding horizon).

        frame     0     1     2     3     4        of a policy of 10 Hz: three steps each
        observe   o0    o1    o2    o3    o4       state, and the human action of the frame before
        plan A    a0    a1    a2    ..             asked for before the start, when the table rests
        plan B               (o2)  b1    b2        asked for at frame 2; its b0 was due while it was being made

    A frame's action is held for 30 / fps steps, at the rate of the data that the policy learned from. The next plan is
    asked for one frame before `actions_per_plan` frames of this one are executed, and taken up at the first frame after
    it is ready, at the action that this frame is due, never from its beginning. A slow plan so never holds the loop;
    where a plan runs out, its player lets go.

    Attributes:
        latencies: seconds that each plan took.
    """

    is_person = False

    def __init__(self, planner: JointPlanner, clock: Callable[[], int] = time.monotonic_ns):
        self.name = planner.name
        self.latencies: list[float] = []
        self._planner = planner
        self._clock = clock
        self._hold = stride(planner.fps)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="policy")
        self._pending: Future[_Plan] | None = None
        self._forget()

    def _forget(self) -> None:
        self._plan: _Plan | None = None
        self._force = ZERO
        self._age_from = 0
        self._step = 0
        self._held: list[np.ndarray] = []

    def begin(self, seat: int, map_config: MapConfig, seed: int) -> None:
        """Forgets, and asks for the first plan: the table rests at the start until the count-down is over."""
        if self._pending is not None:
            self._pending.cancel()
        self._forget()
        self._hold = stride(self._planner.fps)  # another policy may plan now
        self._worker.submit(self._planner.seed, seed)  # after a plan that still runs
        self._seat = seat
        self._map = environment_state(map_config)
        rest = state_vector(map_config.start, (0.0, 0.0, 0.0))
        # Before the start there is nothing: the first observation is repeated, as it is padded in training.
        self._states: deque[np.ndarray] = deque([rest] * self._planner.frames, maxlen=self._planner.frames)
        self._human: deque[np.ndarray] = deque([np.zeros(2)] * self._planner.frames, maxlen=self._planner.frames)
        self._ask(0)

    def read(self, state: np.ndarray) -> Reading:
        """The force of the present frame."""
        frame, within = divmod(self._step, self._hold)
        if within == 0:
            if frame > 0:
                self._states.append(np.array(state))
                self._human.append(frame_actions(np.array(self._held), self._planner.fps)[0, 2:].copy())
                self._held = []
            self._take(frame)
        age = self._clock() - self._age_from if self._age_from else 0
        return Reading(self._force, PlayerInput(axes=self._force, age_ns=age))

    def executed(self, action: np.ndarray) -> None:
        """Keeps the action for the history."""
        self._held.append(np.array(action))
        self._step += 1

    def wait(self, timeout_s: float | None = None) -> None:
        """Waits for the plan that is being made, if there is one; a check of a checkpoint before a session."""
        if self._pending is not None:
            self._pending.result(timeout_s)

    def close(self) -> None:
        """Ends the thread after the plan that it is making."""
        self._worker.shutdown(cancel_futures=True)

    def _take(self, frame: int) -> None:
        if self._pending is not None and self._pending.done():
            self._plan, self._pending = self._pending.result(), None
            self.latencies.append(self._plan.seconds)
        plan = self._plan
        used = frame - plan.frame if plan is not None else 0
        if self._pending is None and (plan is None or used + 1 >= self._planner.actions_per_plan):
            self._ask(frame)
        if plan is None or used >= len(plan.actions):
            self._force, self._age_from = ZERO, 0
            return
        x, y = np.clip(plan.actions[used, 2 * self._seat : 2 * self._seat + 2], -1.0, 1.0).tolist()
        self._force, self._age_from = (x, y), plan.observed_ns

    def _ask(self, frame: int) -> None:
        history = {
            STATE: np.array(self._states),
            ENVIRONMENT_STATE: np.repeat(self._map[None], self._planner.frames, axis=0),
            HUMAN_ACTION: np.array(self._human),
        }
        self._pending = self._worker.submit(self._make, frame, history, self._clock())

    def _make(self, frame: int, history: dict[str, np.ndarray], observed_ns: int) -> _Plan:
        started = time.perf_counter()
        actions = self._planner.plan(history)
        return _Plan(frame, actions, observed_ns, time.perf_counter() - started)
