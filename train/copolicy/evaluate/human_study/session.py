"""One session of the study: a person (or a simulated one) at the human seat, through collect's `play`."""

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
    """Runs or continues a participant's session until it is complete or somebody ends it.

    Args:
        human: who sits at the human seat: a joystick, the keyboard, or a simulated player.
        out: folder of all sessions.
        device: where the robots plan.
        play: further settings of `play`.

    Returns:
        What was recorded, JSON-able.

    Raises:
        CopolicyError: a checkpoint that is not the plan's, or a session that cannot be run.
    """
    if human.kind not in ("joystick", "keyboard", "scripted"):
        raise InvalidValueError("--human", "joystick, keyboard or scripted[:PAIR]", f"{human.kind}:{human.detail}")
    trials = plan.of(participant)
    # Sits at the robot's seat until the robots of the plan take over.
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
    """The plan's checkpoints by name.

    Raises:
        FileFormatError: one is missing or has other weights than the plan says.
    """
    robots = {}
    for robot in plan.robots:
        found = weights_digest(robot.checkpoint)
        if found != robot.weights_sha256:
            raise FileFormatError(
                robot.checkpoint, f"the plan's weights {robot.weights_sha256[:12]}", f"weights {found[:12]}"
            )
        robots[robot.name] = Checkpoint(robot.checkpoint, device, plan.settings)
    return robots
