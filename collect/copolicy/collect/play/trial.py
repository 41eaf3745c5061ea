"""One episode while it runs: the rollout, the recorder, and how well the loop keeps its time."""

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
    """One episode, from its first step to its verdict.

    The recording stays a `.part` until the verdict, which is known only after the end, is part of it. Everything
    before is on the disk within a second, the end at once.

    Attributes:
        agents: robot seat, human seat.
        outcome: how it stands.
        pose: of the body.
        before: pose before the last step.
        forces: the last action as arrows, robot xy, human xy.
        interaction: of the last step, units of a player's full force; None where the task measures none.
        score: sum of rewards.
        trail: poses, one in three.
        loop: how well the loop kept its time.
        notes: of the operator.
        paused: how often it was paused.
    """

    path: Path
    task: PairTask
    map_config: Any
    seating: int
    agents: tuple[Agent, Agent]
    meta: EpisodeMeta
    anchor: WallClockAnchor
    physics: Any
    practice: bool
    clock: Callable[[], int] = time.monotonic_ns

    def __post_init__(self):
        task, physics = self.task, self.physics
        self._rollout = Rollout(task, [self.map_config], self.agents, seeds=[self.meta.seed], settings=physics)
        self.world: Any = self._rollout.worlds[0]
        self.step_limit = physics.step_limit
        self.outcome: Outcome = RUNNING
        self._outline = task.required_outline
        self.pose: Pose = self._seen_pose()
        self.before = self.pose
        self.forces = (0.0, 0.0, 0.0, 0.0)
        self.interaction: float | None = None
        self.score = 0.0
        self.trail: list[Pose] = [self.pose]
        self.loop = LoopStatistics(task.spec.record_hz)
        self.notes: list[str] = []
        self.paused = 0
        self.step_ns = self.clock()
        self._off_centre: set[int] = set()
        self._stack = ExitStack()
        self._recorder: EpisodeRecorder | None = None

    @property
    def began(self) -> bool:
        """There is a recording."""
        return self._recorder is not None

    @property
    def steps(self) -> int:
        """Steps so far."""
        return self.world.step_count

    @property
    def seconds(self) -> float:
        """Simulated time so far."""
        return self.steps / self.task.spec.record_hz

    def begin(self, devices: Mapping[str, str]) -> None:
        """Opens the recording.

        Raises:
            OSError: the file cannot be written.
        """
        recorder = EpisodeRecorder(
            self.path,
            self.map_config,
            self.meta,
            self.anchor,
            task=self.task.spec.name,
            monotonic_ns=self.clock(),
            devices=devices,
            settings=self.physics,
        )
        self._recorder = self._stack.enter_context(recorder)
        if self.practice:
            self.event("practice")  # what a crash leaves behind must say so too

    def step(self, tick: Tick) -> None:
        """One step: reads the state and both players, records, advances.

        Raises:
            OSError: the recording cannot be written.
        """
        world = self.world
        self.before, self.step_ns = self.pose, tick.start_ns
        self._rollout.step()
        self._watch_sticks()
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
        self._open.step(
            action,
            world.recorded,
            reward,
            monotonic_ns=tick.start_ns,
            inputs=(self.agents[0].input, self.agents[1].input),
            timing=timing,
        )
        self._show(action)
        self.score += reward
        if self.steps % 3 == 0:
            self.trail.append(self.pose)
        if self.outcome.done:
            self.event("outcome", self.outcome.reason)

    def _seen_pose(self) -> Pose:
        x, y, theta = self._outline.poses(self.world.observation[None])[0].tolist()
        return x, y, theta

    def _show(self, action: np.ndarray) -> None:
        self.pose = self._seen_pose()
        x0, y0, x1, y1 = self._outline.forces(action[None])[0].tolist()
        self.forces = (x0, y0, x1, y1)
        measured = self.task.interaction(self.world.observation[None], action[None])
        self.interaction = None if measured is None else float(measured[0])

    def _watch_sticks(self) -> None:
        for seat, agent in enumerate(self.agents):
            if isinstance(agent, PersonAgent) and agent.push_at_rest and seat not in self._off_centre:
                self._off_centre.add(seat)
                self.event(OFF_CENTRE, f"{PLAYERS[seat]}: pushes with {agent.push_at_rest:.2f} at rest")

    def event(self, kind: str, detail: str = "") -> None:
        """Records an event, if the recording has begun."""
        if self._recorder is not None:
            self._recorder.event(kind, detail, self.clock())

    def pause(self, reason: str) -> None:
        """The steps stop."""
        self.paused += 1
        self.forces = (0.0, 0.0, 0.0, 0.0)
        self.before = self.pose
        self.event("pause", reason)

    def resume(self) -> None:
        """The steps go on; what lay between is no part of the loop's time."""
        self.loop.pause()
        self.event("resume")

    def note(self, text: str) -> None:
        """Adds a note of the operator."""
        self.notes.append(text)
        self.event("note", text)

    def finish(self, discarded: bool = False, reason: str = "") -> None:
        """The verdict on an episode that has ended.

        Raises:
            OSError: the recording cannot be completed; what there is stays as `.part`.
        """
        self._end(self.outcome.success, self.outcome.reason, discarded, reason, ())

    def interrupt(self, termination: str, reason: str) -> None:
        """Ends an episode before its end, discarded: nobody decided how it would have gone.

        Args:
            termination: one of `termination_reasons`.
            reason: for the notes.
        """
        self._end(False, termination, True, reason, ("interrupted",))

    def abandon(self, error: BaseException) -> None:
        """Ends the recording after an error: what can be written is completed and marked, the rest stays `.part`."""
        # What could not be written to a full disk cannot be written now either.
        with contextlib.suppress(OSError):
            self._stack.__exit__(type(error), error, error.__traceback__)

    def _end(self, success: bool, termination: str, discarded: bool, reason: str, flags: Sequence[str]) -> None:
        if self.practice:
            flags = (PRACTICE, *flags)
        if self.paused:
            flags = (*flags, "paused")
        if self.loop.slow:
            flags = (*flags, "slow_loop")
        if self._off_centre:
            flags = (*flags, OFF_CENTRE)
        self.event("verdict", "discard" if discarded else "keep")
        self.event("loop", self.loop.summary())
        plans = _latencies(self.agents)
        if plans:
            self.event("plans", plans)
        notes = [f"discarded: {reason}"] if discarded and reason else []
        self._open.finish(
            success,
            termination,
            achieved_hz=self.loop.achieved_hz,
            late_ticks=self.loop.late,
            quality_flags=",".join(flags),
            discarded=discarded or self.practice,
            notes="; ".join([*notes, *self.notes]),
        )
        self._stack.close()

    @property
    def _open(self) -> EpisodeRecorder:
        assert self._recorder is not None, "a step before the recording was opened"
        return self._recorder


def _latencies(agents: Sequence[Agent]) -> str:
    """How long policies planned, where any did."""
    lines = []
    for seat, agent in enumerate(agents):
        if isinstance(agent, PolicyAgent) and agent.latencies:
            p50, most = np.percentile(agent.latencies, (50, 100)) * 1e3
            lines.append(f"seat {seat}: {len(agent.latencies)} plans, p50 {p50:.0f} ms, max {most:.0f} ms")
    return "; ".join(lines)
