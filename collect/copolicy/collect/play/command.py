"""The flags of `copolicy-collect play`."""

import argparse
import logging
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import POLICIES
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number
from copolicy.dataset.command_line.maps_flag import add_maps_flag, add_task_flag, map_set_name
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask, get_task

from ..angular_limit import ANGULAR_LIMITS, LIMIT_SETTING, angular_limit_of, with_angular_limit
from .settings import PlayerSpec, PlaySettings

_COPIED_FLAGS = (
    "task", "pair", "out", "orientations", "episodes", "practice", "seed", "license", "headless", "fullscreen", "mute",
    "new_session",
)  # fmt: skip


def add_play_command(commands: Commands) -> None:
    """Adds `play` to the commands of `copolicy-collect`."""
    command = add_command(
        commands,
        "play",
        _play,
        help="let two players act together in a session of episodes, and record each episode",
        example="copolicy-collect play --players keyboard policy:pretrained\n"
        "  copolicy-collect play --pair P01 --out recordings --consent-0 C-17 --consent-1 C-18",
        needs=lambda arguments: POLICIES if any(text.startswith("policy") for text in arguments.players or ()) else (),
    )
    command.add_argument(
        "--pair", default="guest", help="pseudonym of the pair; its players are PAIR-a and PAIR-b (default: guest)"
    )
    command.add_argument(
        "--out",
        type=Path,
        default=Path("outputs/sessions"),
        help="folder of all sessions; an unfinished session there is continued (default: outputs/sessions)",
    )
    command.add_argument(
        "--players",
        nargs=2,
        metavar=("A", "B"),
        help="the players: joystick (any gamepad), keyboard, scripted[:PAIR], replay:FILE, policy:CKPT or "
        "policy:pretrained (the model in the package); A starts in the robot seat, unless only B is a policy "
        "(default: the connected gamepads, else the keyboard)",
    )
    add_task_flag(command)
    add_maps_flag(command, "training", use_default=False)
    command.add_argument("--orientations", action="store_true", help="use each map with four start orientations")
    command.add_argument(
        "--episodes",
        type=whole_number("--episodes"),
        default=36,
        help="number of episodes to keep in the session (default 36)",
    )
    command.add_argument(
        "--practice",
        type=whole_number("--practice", 0),
        default=0,
        help="number of practice episodes before them, marked and discarded (default 0)",
    )
    command.add_argument(
        "--seed", type=seed(), default=0, help="seed of the schedule and of scripted players (default 0)"
    )
    command.add_argument(
        "--seats",
        choices=("swap", "fixed"),
        help="swap: change seats in the middle of the session (default for two people); fixed: keep them",
    )
    command.add_argument("--consent-0", default="", metavar="ID", help="id of player a's consent record (not a name)")
    command.add_argument("--consent-1", default="", metavar="ID", help="id of player b's consent record (not a name)")
    command.add_argument(
        "--license", default="", help="license of the recordings, by its id on the Hub, such as cc-by-4.0"
    )
    command.add_argument(
        "--angular-limit",
        choices=ANGULAR_LIMITS,
        help="bound on the angular acceleration, rad/s^2 (default: that of a policy's training data, else pi/2)",
    )
    command.add_argument(
        "--countdown", type=number("--countdown", 0, 60), default=3.0, help="seconds before each episode (default 3)"
    )
    command.add_argument("--new-session", action="store_true", help="start a new session instead of continuing one")
    command.add_argument("--headless", action="store_true", help="no window; plays in real time, keeps every episode")
    command.add_argument("--fullscreen", action="store_true", help="start in full screen (F11 toggles it)")
    command.add_argument("--window", metavar="WxH", help="size of the window (default: fits the desktop)")
    command.add_argument("--mute", action="store_true", help="no sounds")
    command.add_argument(
        "--config-dir", type=Path, help="folder of calibrations and mappings (default: the user's settings folder)"
    )


def settings_from_flags(arguments: argparse.Namespace) -> PlaySettings:
    """Returns the settings of a session from its flags.

    Raises:
        CopolicyError: a value is invalid.
    """
    task, specs = get_task(arguments.task), None
    if arguments.players:
        first, second = (PlayerSpec.parse(text, arguments.task) for text in arguments.players)
        specs = (first, second)
    return PlaySettings(
        **{name: getattr(arguments, name) for name in _COPIED_FLAGS},
        players=specs,
        maps=map_set_name(task, arguments.maps, "training"),
        swap_seats={"swap": True, "fixed": False, None: None}[arguments.seats],
        consents=(arguments.consent_0, arguments.consent_1),
        angular_limit=_angular_limit(specs or (), arguments.angular_limit, task),
        window=_size(arguments.window),
        config_folder=arguments.config_dir,
        countdown_s=arguments.countdown,
    )


def _angular_limit(specs: Iterable[PlayerSpec], flag: str | None, task: PairTask | None = None) -> float | None:
    """Returns the flag's limit, or that of the policies' training data; logs a warning where the two differ."""
    # Imported here, since only a session with a policy needs it.
    from ..agents.checkpoint_folder import checkpoint_folder
    from ..agents.training_conditions import training_conditions

    task = task or get_task()
    defaults = task.settings_type()
    default_limit = angular_limit_of(defaults)
    flag_limit = None if flag is None else angular_limit_of(with_angular_limit(task, defaults, flag))
    trained: dict[str, float] = {}
    for spec in specs:
        if spec.kind == "policy":
            conditions = training_conditions(checkpoint_folder(spec.detail))
            if conditions.task != task.spec.name:
                expected = f"a policy that has learned the task {task.spec.name!r}"
                raise InvalidValueError(f"policy:{spec.detail}", expected, conditions.task)
            for note in conditions.notes:
                logging.info("%s: %s", spec.detail, note)
            settings = conditions.settings
            if default_limit is not None:
                trained[spec.detail] = getattr(settings, LIMIT_SETTING)
                settings = with_angular_limit(task, settings, default_limit)
            if settings != defaults:
                logging.warning("%s: trained with other physics than those of play: %s", spec.detail, settings)
    if flag_limit is None:
        if len(set(trained.values())) > 1:
            raise InvalidValueError(
                "--angular-limit", "one value, since the policies were trained with different ones", trained
            )
        return next(iter(trained.values()), default_limit)
    for name, limit in trained.items():
        if not math.isclose(limit, flag_limit):
            logging.warning("--angular-limit %s: %s was trained with %.4g rad/s^2", flag, name, limit)
    return flag_limit


def _play(arguments: argparse.Namespace) -> dict[str, Any]:
    settings = settings_from_flags(arguments)
    # Imported here, since pygame is slow to import and `--help` does not need it.
    from .session_run import play

    return play(settings)


def _size(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise InvalidValueError("window", "WxH, such as 1200x760", text)
    return int(width), int(height)
