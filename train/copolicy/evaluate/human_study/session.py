"""Runs one session of the study with `copolicy-collect play`, a person or a scripted agent at the human's seat."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.agents import Policy, PolicyAgent, PolicyProcess
from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.collect.play.session_run import prepared, stopped_by_signals
from copolicy.collect.play.settings import PlayerSpec
from copolicy.collect.rollout import EpisodeStart
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.task import get_task
from copolicy.train.processor_files import processors_sha256

from .plan import Robot, StudyPlan, weights_digest
from .schedule import BlindPolicy, StudySchedule, StudySettings


def run_session(
    plan: StudyPlan,
    participant: str,
    human: PlayerSpec,
    out: Path,
    device: str = "cpu",
    inference: str = "process",
    **play: Any,
) -> dict[str, Any]:
    """Runs or continues a participant's session until it is complete or is ended.

    Args:
        human: agent at the human's seat: a joystick, the keyboard, or a scripted agent.
        out: folder of all sessions.
        device: device of the policies.
        inference: runs the policies in a `process` of their own, or in a `thread` beside the control loop.
        play: further `StudySettings`.

    Returns:
        Summary of the recorded episodes; it can be written as JSON.

    Raises:
        CopolicyError: a checkpoint is not the plan's, or the session cannot be run.
    """
    if human.kind not in ("joystick", "keyboard", "scripted"):
        raise InvalidValueError("--human", "joystick, keyboard or scripted[:PAIR]", f"{human.kind}:{human.detail}")
    trials = plan.trials_of(participant)
    # At the robot's seat until `set_schedule` replaces it by the plan's robots.
    placeholder = PlayerSpec.parse("scripted", plan.task_name)
    settings = StudySettings(
        pair=participant,
        out=out,
        players=(placeholder, human),
        episodes=len(trials),
        seed=plan.seed,
        swap_seats=False,
        may_exchange_seats=False,
        once=True,
        plan=plan,
        task=plan.task_name,
        **play,
    )
    robots: dict[str, Policy] = {}
    with ExitStack() as stack:

        def load() -> None:
            require_planned_weights(plan)
            loader = partial(load_robots, plan.robots, plan.settings, device, plan.task_name, plan.configurations[0])
            if inference == "thread":
                robots.update(loader())
                return
            process = PolicyProcess(loader)
            stack.callback(process.close)
            robots.update(process.policies)

        application = stack.enter_context(prepared(settings, ("the robots of the study, with torch and LeRobot", load)))
        policy: Any = BlindPolicy(robots, plan.actions_per_plan)
        agent = PolicyAgent(policy, plan.task, real_time=True)
        stack.callback(agent.close)
        game = application.game
        game.set_schedule(StudySchedule(plan, participant, policy, agent), agent)
        with stopped_by_signals(game):
            application.run()
        summary = application.summary()
    questions = {"questionnaires": "not asked: no window"} if plan.questionnaires and not settings.answered_by() else {}
    return {"participant": participant, "plan": plan.plan_id, **summary, **questions}


def require_planned_weights(plan: StudyPlan) -> None:
    """Compares the weights and processors of the robots with those of the plan.

    Raises:
        FileFormatError: a checkpoint is missing, or has other weights or processors.
    """
    for robot in plan.robots:
        digest = weights_digest(robot.checkpoint)
        if digest != robot.weights_sha256:
            raise FileFormatError(
                robot.checkpoint, f"the plan's weights {robot.weights_sha256[:12]}", f"weights {digest[:12]}"
            )
        processors = processors_sha256(checkpoint_folder(robot.checkpoint))
        if robot.processors_sha256 not in ("", processors):
            raise FileFormatError(
                robot.checkpoint,
                f"the plan's processors {robot.processors_sha256[:12]} (policy_*processor* files)",
                f"processors {processors[:12]}",
            )


def load_robots(
    robots: Sequence[Robot], settings: Mapping[str, Any], device: str, task_name: str, start: Any
) -> Mapping[str, Policy]:
    """Loads checkpoints by the names of the robots, and predicts one chunk with each: the first takes longer.

    Args:
        settings: of the policies, see `StudyPlan`.
        start: scenario of that chunk.

    Raises:
        FileFormatError: a checkpoint cannot be loaded.
    """
    # Imported here, since only the process that plans needs torch.
    from copolicy.train.checkpoint import Checkpoint

    task = get_task(task_name)
    state = task.make_world(start, task.settings_type()).observation
    loaded: dict[str, Policy] = {}
    for robot in robots:
        loaded[robot.name] = policy = Checkpoint(robot.checkpoint, device, settings)
        agent = PolicyAgent(policy, task)
        agent.begin(0, [EpisodeStart(start, 0, state)])
        agent.act(state[None], np.arange(1))
    return loaded
