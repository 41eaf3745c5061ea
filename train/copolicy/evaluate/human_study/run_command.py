"""`copolicy-eval human run`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number
from copolicy.dataset.publication.licences import checked_licence


def add_run(steps: Commands) -> None:
    """Adds `human run`."""
    command = add_command(
        steps,
        "run",
        _run,
        "run a participant's session in the window of `copolicy-collect play`, or continue an unfinished one",
        "copolicy-eval human run study/plan.json --participant P01 --out study/recordings --consent C-17",
        POLICIES,
    )
    command.add_argument("plan", type=Path, help="file written by `copolicy-eval human plan`")
    command.add_argument("--participant", required=True, help="code of the participant in the plan: P01, P02, ...")
    command.add_argument("--out", required=True, type=Path, help="folder of all sessions, one MCAP file per episode")
    command.add_argument(
        "--human", default="joystick", help="joystick, keyboard, or scripted[:PAIR] to try the procedure without people"
    )
    add_whole_number(command, "--practice", "practice episodes, not counted (default: 2)", 2, 0, 1000)
    command.add_argument(
        "--break",
        dest="break_s",
        type=number("--break", 0, 3600),
        default=60.0,
        metavar="SECONDS",
        help="shortest break between two robots (default: 60)",
    )
    command.add_argument("--consent", default="", metavar="ID", help="record id of the person's consent, not a name")
    command.add_argument("--license", default="", help="licence of the recordings, a Hub id such as cc-by-4.0")
    command.add_argument(
        "--countdown", type=number("--countdown", 0, 60), default=3.0, help="seconds before each episode (default: 3)"
    )
    command.add_argument("--device", default="cpu", help="device of the policies (default: cpu)")
    command.add_argument(
        "--inference",
        choices=("process", "thread"),
        default="process",
        help="runs the policies in a process of their own, or in a thread, which needs less memory but can delay the "
        "control loop (default: process)",
    )
    command.add_argument("--new-session", action="store_true", help="do not continue the unfinished session")
    command.add_argument("--headless", action="store_true", help="no window, in real time; every episode is kept")
    command.add_argument("--fullscreen", action="store_true", help="start in full screen")
    command.add_argument("--mute", action="store_true", help="no sounds")


def _run(arguments: argparse.Namespace) -> dict[str, Any]:
    from copolicy.collect.play.settings import PlayerSpec

    from .plan import StudyPlan

    checked_licence(arguments.license)
    plan = StudyPlan.read(arguments.plan)
    plan.trials_of(arguments.participant)
    human = PlayerSpec.parse(arguments.human, plan.task_name)
    # Imported here so that argument errors do not wait for torch and pygame.
    from .session import run_session

    return run_session(
        plan,
        arguments.participant,
        human,
        arguments.out,
        arguments.device,
        arguments.inference,
        break_s=arguments.break_s,
        practice=arguments.practice,
        consents=("", arguments.consent),
        license=arguments.license,
        countdown_s=arguments.countdown,
        new_session=arguments.new_session,
        headless=arguments.headless,
        fullscreen=arguments.fullscreen,
        mute=arguments.mute,
    )
