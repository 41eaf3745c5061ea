"""Records an episode while it happens."""

import contextlib
import math
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np

from copolicy.dataset.episode import EpisodeMeta, TerminationReason
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.dataset.files.staging import about
from copolicy.dataset.interaction import identical, may_be_one_device
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.log import read_episode
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming, PlayerInput
from copolicy.dataset.recording.topics import SCENE, SCENE_MAP
from copolicy.dataset.task import RECORD_HZ
from copolicy.tasks.table.artist.scene import TableScene, map_scene
from copolicy.tasks.table.artist.scene_solids import TableFrame, solid_records
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.routes import route_class

from . import episode_messages
from .episode_file import EpisodeFile
from .episode_messages import Record, Triple, checked_forces, checked_state
from .wall_clock import WallClockAnchor

# A killed process loses what came after the last flush, and the action of the step before it, whose outcome was not
# flushed yet: together less than a second, even where the loop runs a little early.
_FLUSH_NS = 9 * 10**8


IDENTICAL_ACTIONS = "identical_actions"
"""Quality flag of an episode in which two people at gamepads gave the same actions: one is listed twice."""


class EpisodeRecorder:
    """Writes one episode to `NAME.mcap.part`, which becomes `NAME.mcap` once it is complete and on the disk.

    The recording begins with the state s_0. Each `step` takes the action u_k, chosen in the last state that was
    given, and the state s_{k+1} that it led to; `finish` says how it ended:

        with EpisodeRecorder(path, map_config, meta, anchor) as recorder:
            while not outcome.done:
                outcome = world.step(action)
                recorder.step(action, world.pose, world.velocity, world.reward())
            recorder.finish(outcome.success, outcome.reason)

    What is recorded of step k carries the time of step k. The file is flushed every 0.9 s of recording and at
    every event, so that a killed process loses at most a second, and its `.part` stays. A block that is left
    without `finish` completes its file all the same, up to the last state: as `operator_discard`, marked
    discarded, where it was left in order or by Ctrl-C; as `crash_recovered` with the quality flag `aborted` where
    it was left by another exception. Should that file not read back, it stays a `.part`. An episode of two
    people at gamepads whose actions are the same gets the flag `identical_actions`.

    Attributes:
        meta: the episode's columns, complete after `finish`.
        steps: steps recorded so far.
    """

    def __init__(
        self,
        path: Path | str,
        map_config: MapConfig,
        meta: EpisodeMeta,
        anchor: WallClockAnchor | None = None,
        *,
        pose: Triple | None = None,
        velocity: Triple = (0.0, 0.0, 0.0),
        monotonic_ns: int | None = None,
        devices: Mapping[str, str] | None = None,
        physics: Physics | None = None,
    ):
        """Prepares a recording; the file appears when the `with` block is entered.

        Args:
            path: of the finished file, `NAME.mcap`.
            map_config: the map.
            meta: all that is known at the start; `finish` fills in the columns of the result.
            anchor: of the session's clock, by default now.
            pose: of s_0 (px, px, rad), by default the map's start.
            velocity: of s_0 (px/s, px/s, rad/s).
            monotonic_ns: when s_0 was read, by default the anchor's moment.
            devices: what is known of the devices; no serial numbers, since those identify people.
            physics: settings of the world that the states come from.
        """
        self.meta = meta
        self.steps = 0
        self._path = Path(path)
        self._map_config = map_config
        self._anchor = anchor or WallClockAnchor.now()
        self._devices = dict(devices or {})
        self._physics = physics or Physics()
        self._begin_ns = self._anchor.monotonic_ns if monotonic_ns is None else monotonic_ns
        self._time_ns = self._begin_ns  # of the present step
        self._flushed_ns = self._begin_ns
        self._pose, self._velocity = checked_state(map_config.start if pose is None else pose, velocity)
        self._positions = array("d", self._pose[:2])
        self._total_reward = 0.0
        self._forces = array("d")
        self._scene, self._frame = TableScene(), TableFrame()
        self._ended = False

    def __enter__(self) -> "EpisodeRecorder":
        """Opens the file and writes what is known at the start.

        Raises:
            OutputExistsError: the file, or the remains of a recording that broke off, would be overwritten.
        """
        self._file = EpisodeFile(self._path)
        try:
            with about(self._path):
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
            # The exception may have struck between two records of one step.
            with contextlib.suppress(CopolicyError):
                read_episode(self._file.part)
                self._file.publish()
        except OSError as failure:
            # A full disk: what there is stays in the .part file, and the first error is the one to show.
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
        action: np.ndarray | Sequence[float],
        pose: Triple,
        velocity: Triple,
        reward: float,
        *,
        monotonic_ns: int | None = None,
        inputs: tuple[PlayerInput | None, PlayerInput | None] = (None, None),
        timing: LoopTiming | None = None,
    ) -> None:
        """Records the action of a step and the state after it.

        Args:
            action: `(4,)` robot xy, human xy in [-1, 1], as it acted in the last state.
            pose: after the step (px, px, rad).
            velocity: after the step (px/s, px/s, rad/s).
            reward: after the step.
            monotonic_ns: when the step began (its state was read); by default 1/30 s after the one before.
            inputs: what the players' devices said; their `step` is filled in.
            timing: how well the loop kept its time; its `step` is filled in.

        Raises:
            ShapeError: an action of another shape.
            InvalidValueError: numbers that are not finite or forces beyond [-1, 1]; nothing was recorded.
            RunError: the recording has ended.
        """
        if self._ended:
            raise RunError(f"{self._path}: expected no step after the end of the recording, found one")
        forces = checked_forces(action)
        after = checked_state(pose, velocity)
        step = self.steps
        if monotonic_ns is not None:
            self._time_ns = monotonic_ns
        # Nothing of a step is written before all of it is known to be sound.
        records = self._state_records(forces)
        records += episode_messages.action_records(step, forces)
        records += episode_messages.device_records(step, inputs, timing)
        records.append(episode_messages.interaction_record(step, after[0][2], forces, float(reward)))
        self._write(records)
        self.steps = step + 1
        self._pose, self._velocity = after
        self._positions.extend(self._pose[:2])
        self._total_reward += float(reward)
        self._forces.extend(forces)
        if monotonic_ns is None:
            self._time_ns = self._begin_ns + self.steps * 10**9 // RECORD_HZ
        else:
            self._time_ns = monotonic_ns + 10**9 // RECORD_HZ
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
        """Records the final state and the result, and gives the file its name once it is on the disk.

        Args:
            success: the table reached the goal.
            termination_reason: one of `TerminationReason`.
            achieved_hz: rate that the loop kept; nan where time is simulated.
            late_ticks: steps that began late.
            quality_flags: comma separated.
            discarded: the operator wants the episode left out of data sets.
            notes: of the operator; no names.

        Raises:
            InvalidValueError: another reason than those of `TerminationReason`.
            OutputExistsError: another file took the name meanwhile; the recording stays as `.part`.
            RunError: the recording has ended already.
        """
        if self._ended:
            raise RunError(f"{self._path}: expected one end of the recording, found another")
        if termination_reason not in get_args(TerminationReason):
            raise InvalidValueError("termination_reason", f"one of {get_args(TerminationReason)}", termination_reason)
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
        records = episode_messages.start_records(self.meta, self._anchor, self._devices, self._physics)
        for name, entries in records.items():
            self._file.add_metadata(name, entries)
        time_ns = self._anchor.at(self._time_ns)
        map_json = self._map_config.to_json().encode()
        self._file.add_attachment(episode_records.MAP_ATTACHMENT, "application/json", map_json, time_ns)
        self._file.declare_topics()
        self._write([(SCENE_MAP, map_scene(self._map_config, time_ns)), *solid_records(self._map_config, time_ns)])
        self.event("start")

    def _end(self, success: bool, termination_reason: str, notes: str = "", **columns: Any) -> None:
        path = np.asarray(self._positions).reshape(-1, 2)
        meta = self.meta
        suspected = may_be_one_device(meta.source, meta.controller_0, meta.controller_1)
        if suspected and identical(np.asarray(self._forces).reshape(-1, 4)):
            columns["quality_flags"] = ",".join(filter(None, (columns.get("quality_flags"), IDENTICAL_ACTIONS)))
        self.meta = replace(
            self.meta,
            success=success,
            termination_reason=termination_reason,
            duration_s=self.steps / RECORD_HZ,
            route_class=route_class(path, self._map_config),
            **columns,
        )
        self._ended = True
        self._write(self._state_records((0.0, 0.0, 0.0, 0.0)))
        self.event("end", termination_reason)
        result = episode_records.encode(self.meta, episode_records.COLUMNS_AT_END)
        result |= {"steps": str(self.steps), "total_reward": repr(self._total_reward), "notes": notes}
        self._file.add_metadata(episode_records.RESULT, result)
        self._file.complete()

    def _state_records(self, forces: tuple[float, ...]) -> list[Record]:
        state = episode_messages.state_record(self.steps, self._pose, self._velocity, self._time_ns)
        time_ns = self._anchor.at(self._time_ns)
        scene = SCENE, self._scene.update(time_ns, self._pose, forces)
        return [state, scene, self._frame.record(time_ns, self._pose)]

    def _write(self, records: list[Record]) -> None:
        time_ns = self._anchor.at(self._time_ns)
        for topic, payload in records:
            self._file.add(topic, payload, time_ns, self.steps)

    def _flush(self) -> None:
        self._file.flush()
        self._flushed_ns = self._time_ns
