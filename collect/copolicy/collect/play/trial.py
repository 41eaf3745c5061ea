"""One episode of a session: its rollout, its recording and the timing of the loop."""

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.outline import Pose
from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming
from copolicy.dataset.task import RUNNING, Outcome, PairTask
from copolicy.dataset.task_spec import PLAYERS

from ..agents import PersonAgent, PolicyAgent
from ..recording.recorder import EpisodeRecorder
from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent, Rollout
from ..session import OFF_CENTRE, PRACTICE
from ..ticker import LoopStatistics, Tick


@dataclass(eq=False)
class Trial:
    """One episode, from its first step to the verdict of the players.

    The recording is a `.part` file until it contains the verdict, which is known only after the end. Steps are on the
    disk within a second, the end of the episode at once.

    Attributes:
        path: of the recording.
        seating: 0 with player a in the robot seat, 1 with player b there.
        agents: of the robot seat and the human seat.
        settings: of the world.
        practice: the episode does not count.
        planned: what a study plans for the episode, recorded as the event `planned`; empty without a plan.
        outcome: of the world after the last step.
        pose: of the body.
        previous_pose: pose before the last step.
        forces: the last action as force vectors, robot xy, human xy.
        interaction: measure of the last step, in the task's unit; None if the task has no measure.
        score: sum of rewards.
        trail: every third pose.
        loop: timing statistics of the loop.
        notes: of the operator.
        pauses: number of pauses.
    """

    path: Path
    task: PairTask
    scenario: Any
    seating: int
    agents: tuple[Agent, Agent]
    meta: EpisodeMeta
    anchor: WallClockAnchor
    settings: Any
    practice: bool
    planned: str = ""
    clock: Callable[[], int] = time.monotonic_ns

    def __post_init__(self) -> None:
        task = self.task
        self._rollout = Rollout(task, [self.scenario], self.agents, seeds=[self.meta.seed], settings=self.settings)
        self.world: Any = self._rollout.worlds[0]
        self.step_limit = self.settings.step_limit
        self.outcome: Outcome = RUNNING
        self._outline = task.required_outline
        self.pose: Pose = self._world_pose()
        self.previous_pose = self.pose
        self.forces = (0.0, 0.0, 0.0, 0.0)
        self.interaction: float | None = None
        self.score = 0.0
        self.trail: list[Pose] = [self.pose]
        self.loop = LoopStatistics(task.spec.record_hz)
        self.notes: list[str] = []
        self.pauses = 0
        self.step_ns = self.clock()
        self._first_step_ns: int | None = None
        self._paused_ns = self._pause_began_ns = 0
        self._off_centre: set[int] = set()
        self._stack = ExitStack()
        self._recorder: EpisodeRecorder | None = None

    @property
    def began(self) -> bool:
        """The recording has been opened."""
        return self._recorder is not None

    @property
    def steps(self) -> int:
        """Number of steps so far."""
        return self.world.step_count

    @property
    def seconds(self) -> float:
        """Simulated time so far, s."""
        return self.steps / self.task.spec.record_hz

    def begin(self, devices: Mapping[str, str]) -> None:
        """Opens the recording.

        Raises:
            OSError: the file cannot be written.
        """
        recorder = EpisodeRecorder(
            self.path,
            self.scenario,
            self.meta,
            self.anchor,
            task=self.task.spec.name,
            monotonic_ns=self.clock(),
            devices=devices,
            settings=self.settings,
        )
        self._recorder = self._stack.enter_context(recorder)
        if self.practice:
            self.event("practice")  # a recording that a crash cuts short must be marked too
        if self.planned:
            self.event("planned", self.planned)

    def step(self, tick: Tick) -> None:
        """Makes one step: reads the state and both players, records, advances the world.

        Raises:
            OSError: the recording cannot be written.
        """
        world = self.world
        self.previous_pose, self.step_ns = self.pose, tick.start_ns
        if self._first_step_ns is None:
            self._first_step_ns = tick.start_ns
        self._rollout.step()
        self._record_off_centre_sticks()
        (action,), (self.outcome,) = self._rollout.actions, self._rollout.outcomes
        reward = world.reward()
        self.loop.add(tick)
        timing = LoopTiming(
            scheduled_ns=tick.scheduled_ns,
            start_ns=tick.start_ns,
            late_ns=tick.late_ns,
            work_ns=self.clock() - tick.start_ns,
            skipped_ticks=tick.skipped if self.loop.ticks > 1 else 0,
        )
        self._opened.step(
            action,
            world.recorded,
            reward,
            monotonic_ns=tick.start_ns,
            inputs=(self.agents[0].input, self.agents[1].input),
            timing=timing,
        )
        self._update_display(action)
        self.score += reward
        if self.steps % 3 == 0:
            self.trail.append(self.pose)
        if self.outcome.done:
            self.event("outcome", self.outcome.reason)

    def _world_pose(self) -> Pose:
        x, y, theta = self._outline.poses(self.world.observation[None])[0].tolist()
        return x, y, theta

    def _update_display(self, action: Array) -> None:
        self.pose = self._world_pose()
        x0, y0, x1, y1 = self._outline.forces(action[None])[0].tolist()
        self.forces = (x0, y0, x1, y1)
        measured = self.task.interaction(self.world.observation[None], action[None])
        self.interaction = None if measured is None else float(measured[0])

    def _record_off_centre_sticks(self) -> None:
        for seat, agent in enumerate(self.agents):
            if isinstance(agent, PersonAgent) and agent.push_at_rest and seat not in self._off_centre:
                self._off_centre.add(seat)
                self.event(OFF_CENTRE, f"{PLAYERS[seat]}: pushes with {agent.push_at_rest:.2f} at rest")

    def event(self, kind: str, detail: str = "") -> None:
        """Records an event if the recording is open."""
        if self._recorder is not None:
            self._recorder.event(kind, detail, self.clock())

    def pause(self, reason: str) -> None:
        """Records a pause; zero forces are shown."""
        self.pauses += 1
        self._pause_began_ns = self.clock()
        self.forces = (0.0, 0.0, 0.0, 0.0)
        self.previous_pose = self.pose
        self.event("pause", reason)

    def resume(self) -> None:
        """Records the end of a pause, whose duration the loop's timing excludes."""
        self.loop.pause()
        if self._first_step_ns is not None:  # a pause before the first step is no part of the wall time
            self._paused_ns += self.clock() - self._pause_began_ns
        self.event("resume")

    def note(self, text: str) -> None:
        """Records a note of the operator."""
        self.notes.append(text)
        self.event("note", text)

    def finish(self, discarded: bool = False, reason: str = "") -> None:
        """Completes the recording of an episode that has ended.

        Raises:
            OSError: the recording cannot be completed; it stays as `.part`.
        """
        self._end(self.outcome.success, self.outcome.reason, discarded, reason, ())

    def interrupt(self, termination: str, reason: str) -> None:
        """Completes the recording of an episode that is stopped early, as discarded.

        Args:
            termination: one of `termination_reasons`.
            reason: for the notes.
        """
        self._end(False, termination, True, reason, ("interrupted",))

    def abandon(self, error: BaseException) -> None:
        """Closes the recording after an error: completed and marked if it can be written, else left as `.part`."""
        # On a full disk this write fails too.
        with contextlib.suppress(OSError):
            self._stack.__exit__(type(error), error, error.__traceback__)

    def _end(self, success: bool, termination: str, discarded: bool, reason: str, flags: Sequence[str]) -> None:
        if self.practice:
            flags = (PRACTICE, *flags)
        if self.pauses:
            flags = (*flags, "paused")
        if self.loop.slow:
            flags = (*flags, "slow_loop")
        if self._off_centre:
            flags = (*flags, OFF_CENTRE)
        self.event("verdict", "discard" if discarded else "keep")
        self.event("loop", self.loop.summary())
        self.event("duration", self._durations())
        latencies = _latency_summary(self.agents)
        if latencies:
            self.event("plans", latencies)
        notes = [f"discarded: {reason}"] if discarded and reason else []
        self._opened.finish(
            success,
            termination,
            achieved_hz=self.loop.achieved_hz,
            late_ticks=self.loop.late,
            quality_flags=",".join(flags),
            discarded=discarded or self.practice,
            notes="; ".join([*notes, *self.notes]),
        )
        self._stack.close()

    def _durations(self) -> str:
        """Simulated time, and wall time without the pauses: until the end of the last step."""
        wall_s = 0.0
        if self._first_step_ns is not None:
            wall_s = (self.step_ns - self._first_step_ns - self._paused_ns) / 1e9 + 1 / self.task.spec.record_hz
        return f"simulated {self.seconds:.3f} s, wall {wall_s:.3f} s, paused {self._paused_ns / 1e9:.3f} s"

    @property
    def _opened(self) -> EpisodeRecorder:
        assert self._recorder is not None, "the recording is not open"
        return self._recorder


def _latency_summary(agents: Sequence[Agent]) -> str:
    """Returns the inference times of the policies at both seats; empty without a policy."""
    lines = []
    for seat, agent in enumerate(agents):
        if isinstance(agent, PolicyAgent) and agent.latencies:
            p50, maximum = np.percentile(agent.latencies, (50, 100)) * 1e3
            mean = np.mean(agent.latencies) * 1e3
            times = f"p50 {p50:.3f} ms, mean {mean:.3f} ms, max {maximum:.3f} ms"
            lines.append(f"seat {seat}: {len(agent.latencies)} plans, {times}")
    return "; ".join(lines)
