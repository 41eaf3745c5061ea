"""Runs one session of the study with `copolicy-collect play`, a person or a scripted agent at the human's seat."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from copolicy.collect.agents import PolicyAgent
from copolicy.collect.play.session_run import prepared, stopped_by_signals
from copolicy.collect.play.settings import PlayerSpec
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.train.checkpoint import Checkpoint

from .plan import StudyPlan, weights_digest
from .schedule import BlindPolicy, StudySchedule, StudySettings


def run_session(
    plan: StudyPlan, participant: str, human: PlayerSpec, out: Path, device: str = "cpu", **play: Any
) -> dict[str, Any]:
    """Runs or continues a participant's session until it is complete or is ended.

    Args:
        human: agent at the human's seat: a joystick, the keyboard, or a scripted agent.
        out: folder of all sessions.
        device: device of the policies.
        play: further `PlaySettings`.

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
        plan=plan,
        task=plan.task_name,
        **play,
    )
    robots: dict[str, Checkpoint] = {}
    load = ("the robots of the study, with torch and LeRobot", lambda: robots.update(load_robots(plan, device)))
    with prepared(settings, load) as application, ExitStack() as stack:
        policy: Any = BlindPolicy(robots, plan.actions_per_plan)
        agent = PolicyAgent(policy, plan.task, real_time=True)
        stack.callback(agent.close)
        game = application.game
        game.set_schedule(StudySchedule(plan, participant, policy, agent), agent)
        with stopped_by_signals(game):
            application.run()
        return {"participant": participant, "plan": plan.plan_id, **application.summary()}


def load_robots(plan: StudyPlan, device: str = "cpu") -> Mapping[str, Checkpoint]:
    """Loads the plan's checkpoints by name.

    Raises:
        FileFormatError: a checkpoint is missing, or its weights are not those of the plan.
    """
    robots = {}
    for robot in plan.robots:
        digest = weights_digest(robot.checkpoint)
        if digest != robot.weights_sha256:
            raise FileFormatError(
                robot.checkpoint, f"the plan's weights {robot.weights_sha256[:12]}", f"weights {digest[:12]}"
            )
        robots[robot.name] = Checkpoint(robot.checkpoint, device, plan.settings)
    return robots
