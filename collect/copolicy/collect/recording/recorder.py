"""Records an episode step by step."""

import contextlib
import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EpisodeMeta, termination_reasons
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.files.staging import named_errors
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.generic_messages import messages_of
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming, PlayerInput
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.recording.topics import Record
from copolicy.dataset.shared_device import identical_actions, may_be_one_device
from copolicy.dataset.task import get_task

from . import episode_messages
from .episode_file import EpisodeFile
from .episode_messages import checked_action, checked_state
from .wall_clock import WallClockAnchor

# A killed process loses the data after the last flush, and the last step before it, whose outcome is not flushed yet:
# together less than a second, even where the loop runs slightly fast.
_FLUSH_NS = 9 * 10**8

IDENTICAL_ACTIONS = "identical_actions"
"""Quality flag of an episode in which two people with gamepads had the same actions: one device is listed twice."""


class EpisodeRecorder:
    """Writes one episode to `NAME.mcap.part`, which is renamed to `NAME.mcap` once it is complete and on the disk.

    The recording begins with the state s_0. Each `step` adds the action u_k, chosen in the last state, and the next
    state s_{k+1}; `finish` adds the outcome:

        with EpisodeRecorder(path, scenario, meta, anchor) as recorder:
            while not outcome.done:
                outcome = world.step(action)
                recorder.step(action, world.recorded, world.reward())
            recorder.finish(outcome.success, outcome.reason)

    All messages of step k have the time of step k. The file is flushed every 0.9 s of recording and at every event, so
    that a killed process loses at most a second, and leaves a `.part`. A `with` block that ends without `finish` also
    completes the file, up to the last state: as `operator_discard`, marked discarded, after a normal exit or Ctrl-C; as
    `crash_recovered` with the quality flag `aborted` after another exception. If that file cannot be read, it stays a
    `.part`. An episode of two people with gamepads whose actions are the same gets the flag `identical_actions`.

    Attributes:
        meta: the episode's columns, complete after `finish`.
        steps: steps recorded so far.
    """

    def __init__(
        self,
        path: Path | str,
        scenario: Any,
        meta: EpisodeMeta,
        anchor: WallClockAnchor | None = None,
        *,
        task: str = "table",
        state: Sequence[float] | None = None,
        monotonic_ns: int | None = None,
        devices: Mapping[str, str] | None = None,
        settings: Any = None,
    ):
        """Prepares a recording; the file is created when the `with` block is entered.

        Args:
            path: of the finished file, `NAME.mcap`.
            scenario: of the task.
            meta: columns that are known at the start; `finish` adds those of the result.
            anchor: of the session's clock, by default now.
            task: name of the task.
            state: s_0 by `TaskSpec.recorded`, by default that of the scenario's start.
            monotonic_ns: when s_0 was read, by default the time of the anchor.
            devices: facts about the devices; no serial numbers, since they identify people.
            settings: of the world; the task's default if None.

        Raises:
            UnknownNameError: the task is not installed.
        """
        self.meta = meta
        self.steps = 0
        self._path = Path(path)
        self._scenario = scenario
        self._task = get_task(task)
        self._messages, self._spec = messages_of(self._task), self._task.spec
        self._anchor = anchor or WallClockAnchor.now()
        self._devices = dict(devices or {})
        self._settings = settings or self._task.settings_type()
        self._begin_ns = self._anchor.monotonic_ns if monotonic_ns is None else monotonic_ns
        self._time_ns = self._begin_ns  # of the present step
        self._flushed_ns = self._begin_ns
        self._state = checked_state(self._task.start_of(scenario) if state is None else state, self._spec)
        self._states = array("d", self._state)
        self._total_reward = 0.0
        self._actions = array("d")
        self._scene = self._messages.scene_writer()
        self._ended = False

    def __enter__(self) -> "EpisodeRecorder":
        """Creates the file and writes the metadata and messages of the start.

        Raises:
            OutputExistsError: the file or an incomplete recording of the same name exists.
        """
        self._file = EpisodeFile(self._path)
        try:
            with named_errors(self._path):
                self._write_start()
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        try:
            if self._ended:
                return
            if kind is None or issubclass(kind, KeyboardInterrupt):
                self._end(False, "operator_discard", discarded=True)
            else:
                self._end(False, "crash_recovered", quality_flags="aborted")
            # The exception may have been raised between two records of one step.
            with contextlib.suppress(CopolicyError):
                read_episode(self._file.part)
                self._file.publish()
        except OSError as failure:
            # A full disk: the data so far stay in the .part file, and the first error is the one to raise.
            if kind is None:
                failure.filename = failure.filename or str(self._path)
                raise
        finally:
            if isinstance(error, OSError):
                error.filename = error.filename or str(self._path)
            with contextlib.suppress(OSError):
                self._file.close()

    def step(
        self,
        action: Array | Sequence[float],
        state: Sequence[float],
        reward: float,
        *,
        monotonic_ns: int | None = None,
        inputs: tuple[PlayerInput | None, PlayerInput | None] = (None, None),
        timing: LoopTiming | None = None,
    ) -> None:
        """Records the action of a step and the state after it.

        Args:
            action: `(m,)` of both players in the last state, robot first.
            state: after the step, by `TaskSpec.recorded` (`World.recorded`).
            reward: after the step.
            monotonic_ns: when the step began, that is, when its state was read; by default a step after the previous.
            inputs: of the players' devices; their `step` is set.
            timing: of the loop; its `step` is set.

        Raises:
            ShapeError: an action or a state of another shape.
            InvalidValueError: numbers that are not finite or actions out of bounds; nothing was recorded.
            RunError: the recording has ended.
        """
        if self._ended:
            raise RunError(f"{self._path}: expected no step after the end of the recording, found one")
        joint, after = checked_action(action, self._spec), checked_state(state, self._spec)
        step, messages, size = self.steps, self._messages, len(self._spec.action)
        if monotonic_ns is not None:
            self._time_ns = monotonic_ns
        # A step is written only after all of it has been checked.
        records = self._state_records(joint)
        for topic, values in zip(messages.actions, (joint[:size], joint[size:]), strict=True):
            records.append((topic, messages.encode_action(step, values)))
        records += episode_messages.device_records(step, inputs, timing)
        records.append((messages.measures, messages.encode_measures(step, after, joint, float(reward))))
        self._write(records)
        self.steps = step + 1
        self._state = after
        self._states.extend(after)
        self._total_reward += float(reward)
        self._actions.extend(joint)
        if monotonic_ns is None:
            self._time_ns = self._begin_ns + self.steps * 10**9 // self._spec.record_hz
        else:
            self._time_ns = monotonic_ns + 10**9 // self._spec.record_hz
        if self._time_ns - self._flushed_ns >= _FLUSH_NS:
            self._flush()

    def event(self, kind: str, detail: str = "", monotonic_ns: int | None = None) -> None:
        """Records an event (`pause`, `resume`, ...) at the present step, and flushes the file."""
        if monotonic_ns is not None:
            self._time_ns = monotonic_ns
        self._write([episode_messages.event_record(self.steps, kind, detail)])
        self._flush()

    def finish(
        self,
        success: bool,
        termination_reason: str,
        *,
        achieved_hz: float = math.nan,
        late_ticks: int = 0,
        quality_flags: str = "",
        discarded: bool = False,
        notes: str = "",
    ) -> None:
        """Records the final state and the result, and renames the file once it is on the disk.

        Args:
            success: whether the players reached the goal.
            termination_reason: one of `termination_reasons`.
            achieved_hz: rate of the loop; nan where time is simulated.
            late_ticks: number of steps that began late.
            quality_flags: comma separated.
            discarded: exclude the episode from data sets.
            notes: of the operator, without names of people.

        Raises:
            InvalidValueError: a reason that the task does not have.
            OutputExistsError: another file has taken the name meanwhile; the recording stays a `.part`.
            RunError: the recording has ended already.
        """
        if self._ended:
            raise RunError(f"{self._path}: expected one end of the recording, found another")
        reasons = termination_reasons(self._spec)
        if termination_reason not in reasons:
            raise InvalidValueError("termination_reason", f"one of {reasons}", termination_reason)
        self._end(
            bool(success),
            termination_reason,
            achieved_hz=float(achieved_hz),
            late_ticks=late_ticks,
            quality_flags=quality_flags,
            discarded=discarded,
            notes=notes,
        )
        self._file.publish()

    def _write_start(self) -> None:
        records = episode_messages.start_records(self.meta, self._anchor, self._devices, self._settings, self._spec)
        for name, entries in records.items():
            self._file.add_metadata(name, entries)
        time_ns = self._anchor.at(self._time_ns)
        scenario = self._scenario.to_json().encode()
        self._file.add_attachment(self._messages.scenario_file, "application/json", scenario, time_ns)
        self._file.declare(self._messages.topics)
        self._write(self._messages.scenario_records(self._scenario, time_ns))
        self.event("start")

    def _end(self, success: bool, termination_reason: str, notes: str = "", **columns: Any) -> None:
        states = self._task.states_of(np.asarray(self._states).reshape(-1, len(self._spec.recorded)))
        meta, joint = self.meta, self._spec.joint_action
        suspected = may_be_one_device(meta.source, meta.controller_0, meta.controller_1)
        actions = np.asarray(self._actions).reshape(-1, len(joint))
        if suspected and identical_actions(self._spec.full_forces(actions)):
            columns["quality_flags"] = ",".join(filter(None, (columns.get("quality_flags"), IDENTICAL_ACTIONS)))
        self.meta = replace(
            self.meta,
            success=success,
            termination_reason=termination_reason,
            duration_s=self.steps / self._spec.record_hz,
            route_class=self._task.strategy(self._scenario, states),
            **columns,
        )
        self._ended = True
        self._write(self._state_records((0.0,) * len(joint)))
        self.event("end", termination_reason)
        result = episode_records.encode(self.meta, episode_records.COLUMNS_AT_END)
        result |= {"steps": str(self.steps), "total_reward": repr(self._total_reward), "notes": notes}
        self._file.add_metadata(episode_records.RESULT, result)
        self._file.complete()

    def _state_records(self, action: tuple[float, ...]) -> list[Record]:
        state = self._messages.encode_state(self.steps, self._state, self._time_ns)
        scene = self._scene(self._anchor.at(self._time_ns), self._state, action)
        return [(self._messages.state, state), *scene]

    def _write(self, records: list[Record]) -> None:
        time_ns = self._anchor.at(self._time_ns)
        for topic, payload in records:
            self._file.add(topic, payload, time_ns, self.steps)

    def _flush(self) -> None:
        self._file.flush()
        self._flushed_ns = self._time_ns
