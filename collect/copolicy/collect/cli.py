"""`copolicy-collect`: commands that make and show recordings."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import add_command, command_parser, run
from copolicy.dataset.command_line.flag_numbers import number, seed, whole_number, workers
from copolicy.dataset.command_line.maps_flag import add_maps_flag, add_task_flag
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import visible_files

from .demonstration.command import add_demo_command
from .maps.command import add_maps_command
from .play.command import add_play_command
from .replay.command import add_replay_command
from .simulate.recipes import RECIPES


def parser() -> argparse.ArgumentParser:
    """The parser of `copolicy-collect` with all its commands."""
    parser, commands = command_parser("copolicy-collect", "Make recordings of two players who carry a table.")
    add_play_command(commands)
    command = add_command(
        commands,
        "simulate",
        _simulate,
        help="record episodes of scripted pairs in simulated time",
        example="copolicy-collect simulate --recipe pairs-sim-376 --out recordings/pairs-sim-376\n  "
        "copolicy-collect simulate --episodes 200 --seed 0 --maps training --out recordings/simulated",
    )
    amount = command.add_mutually_exclusive_group(required=True)
    amount.add_argument("--episodes", type=whole_number("--episodes"), help="how many episodes")
    amount.add_argument(
        "--recipe", choices=sorted(RECIPES), help="a named set of episodes; decides all but --out and --workers"
    )
    command.add_argument("--out", type=Path, required=True, help="folder for the recordings, without any yet")
    command.add_argument("--workers", type=workers(), help="processes (default: one for each processor)")
    # The default is None, so that a flag beside --recipe is an error instead of being ignored.
    command.add_argument("--seed", type=seed(), help="seed of the schedule and of the players (default 0)")
    add_task_flag(command, use_default=False)
    add_maps_flag(command, "training", "map_set", use_default=False)
    command.add_argument(
        "--pairs", nargs="+", metavar="PAIR", help="names of simulated pairs (default: S01 to S05, or all of a task)"
    )
    command.add_argument(
        "--orientations", action="store_true", default=None, help="each map with four start orientations"
    )
    command.add_argument(
        "--start-noise", type=number("--start-noise", 0, 1), metavar="SCALE",
        help="displace the start at random by up to SCALE times the task's range; of the table 90 px, 60 px and "
        "0.6 rad (default 0)",
    )  # fmt: skip
    command.add_argument(
        "--clearance",
        type=number("--clearance", 0, 10, exclusive=True),
        help="factor on the distance that the players keep from obstacles (default: the pair's, 1.7, like people)",
    )
    command = add_command(
        commands,
        "recover",
        _recover,
        help="make readable episodes of incomplete recordings; no file is deleted or changed",
        example="copolicy-collect recover recordings/P01",
    )
    command.add_argument("folder", type=Path, help="folder of recordings, searched with its subfolders")
    command.add_argument(
        "--damaged", action="store_true", help="also recover the intact beginning of damaged finished recordings"
    )
    add_maps_command(commands)
    add_replay_command(commands)
    add_demo_command(commands)
    command = add_command(
        commands,
        "devices",
        _devices,
        help="list the connected gamepads, and test them",
        example="copolicy-collect devices --test 10",
    )
    command.add_argument(
        "--test",
        type=number("--test", 0, 3600, exclusive=True),
        nargs="?",
        const=10.0,
        metavar="SECONDS",
        help="show their input live (default 10 s)",
    )
    command.add_argument(
        "--config-dir", type=Path, help="folder of calibrations and mappings (default: the user's settings)"
    )
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command; returns its exit status."""
    return run(parser(), argv)


def _simulate(arguments: argparse.Namespace) -> dict[str, Any]:
    # Commands import their modules themselves, so that `play` can open its window without delay.
    from .simulate.command import simulate

    flags = {"--task": "task", "--seed": "seed", "--maps": "map_set", "--orientations": "orientations",
             "--pairs": "pairs", "--start-noise": "start_noise",
             "--clearance": "clearance"}  # fmt: skip
    values = {flag: getattr(arguments, name) for flag, name in flags.items() if getattr(arguments, name) is not None}
    if arguments.recipe is None:
        options: dict[str, Any] = {"seed": 0} | {flags[flag]: value for flag, value in values.items()}
        return simulate(arguments.out, arguments.episodes, workers=arguments.workers, **options)
    for flag, value in values.items():
        raise InvalidValueError(flag, f"nothing beside --recipe {arguments.recipe}, which decides it", value)
    return simulate(arguments.out, workers=arguments.workers, **asdict(RECIPES[arguments.recipe]))


def _recover(arguments: argparse.Namespace) -> dict[str, Any]:
    from .recording.recover import recover, summary

    folder = arguments.folder
    recoveries = recover(folder, finished=True, damaged=arguments.damaged)
    # A session without recordings counts as an empty folder.
    if not visible_files(folder, "*.mcap", "*.mcap.part", "session.json") and any(folder.iterdir()):
        raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    return summary(folder, recoveries)


def _devices(arguments: argparse.Namespace) -> dict[str, Any]:
    from .devices import devices_command

    return devices_command(arguments.test, arguments.json, arguments.config_dir)


if __name__ == "__main__":
    sys.exit(main())
