"""The flags of `copolicy-collect play`."""

import argparse
import logging
import math
from collections.abc import Iterable
from pathlib import Path

from copolicy.dataset.command_line.commands import add_command
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, add_task_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask, get_task

from ..angular_limit import ANGULAR_LIMITS, LIMIT_SETTING, angular_limit_of, with_angular_limit
from .settings import PilotSpec, PlaySettings

_AS_GIVEN = (
    "task", "pair", "out", "orientations", "episodes", "practice", "seed", "license", "headless", "fullscreen", "mute",
    "new_session",
)  # fmt: skip


def add_play_command(commands: argparse._SubParsersAction) -> None:
    """Adds `play` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "play",
        _play,
        help="two players carry the table (or act in another task) together: a lobby, a session of episodes, one "
        "recording each",
        example="copolicy-collect play --players keyboard policy:pretrained\n"
        "  copolicy-collect play --pair P01 --out recordings --consent-0 C-17 --consent-1 C-18",
        needs=lambda arguments: POLICIES if any(who.startswith("policy") for who in arguments.players or ()) else (),
    )
    command.add_argument(
        "--pair", default="guest", help="pseudonym of the pair; its players are PAIR-a and PAIR-b (default: guest)"
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("outputs/sessions"),
        help="folder of all sessions; a session continues there (default: outputs/sessions)",
    )
    command.add_argument(
        "--players",
        nargs=2,
        metavar=("A", "B"),
        help="who plays: joystick, keyboard, scripted[:PAIR], replay:FILE, policy:CKPT or policy:pretrained, the model "
        "that comes with the package; A begins on the robot's seat, unless B alone is a policy "
        "(default: the joysticks that are plugged in, the keyboard beside them)",
    )
    add_task_flag(command)
    add_maps_flag(command, "training", use_default=False)
    command.add_argument("--orientations", action="store_true", help="each map with four start orientations")
    command.add_argument(
        "--episodes", type=whole_number("--episodes"), default=36, help="episodes to keep in a session (default 36)"
    )
    command.add_argument(
        "--practice",
        type=whole_number("--practice", 0),
        default=0,
        help="practice episodes before them, marked and discarded",
    )
    command.add_argument("--seed", type=seed(), default=0, help="of the schedule and of simulated players (default 0)")
    command.add_argument(
        "--seats",
        choices=("swap", "fixed"),
        help="swap: the players change seats in the middle of the session (default for two people); fixed: they do not",
    )
    command.add_argument("--consent-0", default="", metavar="ID", help="record id of player a's consent, no name")
    command.add_argument("--consent-1", default="", metavar="ID", help="record id of player b's consent, no name")
    command.add_argument("--license", default="", help="of the recordings, as the Hub spells it, such as cc-by-4.0")
    command.add_argument(
        "--angular-limit",
        choices=ANGULAR_LIMITS,
        help="angular acceleration, rad/s^2 (default: what a policy at the table learned with, else pi/2)",
    )
    command.add_argument(
        "--countdown", type=number("--countdown", 0, 60), default=3.0, help="seconds before each episode (default 3)"
    )
    command.add_argument("--new-session", action="store_true", help="do not continue the pair's unfinished session")
    command.add_argument("--headless", action="store_true", help="no window, in real time; every episode is kept")
    command.add_argument("--fullscreen", action="store_true", help="begin in full screen (F11 changes it)")
    command.add_argument("--window", metavar="WxH", help="size of the window (default: what suits the desktop)")
    command.add_argument("--mute", action="store_true", help="no sounds")
    command.add_argument(
        "--config-dir", type=Path, help="folder of the sticks' calibrations (default: the user's settings)"
    )


def settings_of(arguments: argparse.Namespace) -> PlaySettings:
    """The settings behind the flags.

    Raises:
        CopolicyError: a value that cannot be.
    """
    task, pilots = get_task(arguments.task), None
    if arguments.players:
        first, second = (PilotSpec.parse(text, arguments.task) for text in arguments.players)
        pilots = (first, second)
    return PlaySettings(
        **{name: getattr(arguments, name) for name in _AS_GIVEN},
        pilots=pilots,
        maps=map_set_name(task, arguments.maps, "training"),
        swap_seats={"swap": True, "fixed": False, None: None}[arguments.seats],
        consents=(arguments.consent_0, arguments.consent_1),
        angular_limit=_angular_limit(pilots or (), arguments.angular_limit, task),
        window=_size(arguments.window),
        config_folder=arguments.config_dir,
        countdown_s=arguments.countdown,
    )


def _angular_limit(pilots: Iterable[PilotSpec], flag: str | None, task: PairTask | None = None) -> float | None:
    """The limit that the policies in the session learned with; a flag wins, and is said to contradict them."""
    # What a session without a policy does without.
    from ..agents.checkpoint_folder import checkpoint_folder
    from ..agents.training_conditions import training_conditions

    task = task or get_task()
    usual = task.settings_type()
    bound = angular_limit_of(usual)
    given = None if flag is None else angular_limit_of(with_angular_limit(task, usual, flag))
    learned: dict[str, float] = {}
    for pilot in pilots:
        if pilot.kind == "policy":
            conditions = training_conditions(checkpoint_folder(pilot.detail))
            if conditions.task != task.spec.name:
                expected = f"a policy that has learned the task {task.spec.name!r}"
                raise InvalidValueError(f"policy:{pilot.detail}", expected, conditions.task)
            for note in conditions.notes:
                logging.info("%s: %s", pilot.detail, note)
            rest = conditions.settings
            if bound is not None:
                learned[pilot.detail] = getattr(conditions.settings, LIMIT_SETTING)
                rest = with_angular_limit(task, rest, bound)
            if rest != usual:
                logging.warning("%s: learned under other physics than those of play: %s", pilot.detail, rest)
    if given is None:
        if len(set(learned.values())) > 1:
            raise InvalidValueError(
                "--angular-limit", "a choice, since the policies learned with different ones", learned
            )
        return next(iter(learned.values()), bound)
    for name, limit in learned.items():
        if not math.isclose(limit, given):
            logging.warning("--angular-limit %s: %s learned with %.4g rad/s^2", flag, name, limit)
    return given


def _play(arguments: argparse.Namespace) -> dict:
    settings = settings_of(arguments)
    # Loading pygame takes a moment that `--help` should not.
    from .session_run import play

    return play(settings)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InvalidValueError("window", "WxH, such as 1200x760", text)
    return int(width), int(height)
