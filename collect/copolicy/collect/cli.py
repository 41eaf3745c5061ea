"""`copolicy-collect`: everything that makes recordings."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.commandline import add_command, command_parser, run
from copolicy.dataset.task import MAP_SETS

from .recover import recover, summary
from .simulate import simulate


def parser() -> argparse.ArgumentParser:
    """The parser of `copolicy-collect` with all its commands."""
    parser, commands = command_parser("copolicy-collect", "Make recordings of two players who carry a table.")
    command = add_command(
        commands,
        "simulate",
        _simulate,
        help="record episodes of scripted pairs, as fast as the machine goes",
        example="copolicy-collect simulate --episodes 200 --seed 0 --maps training --out recordings/simulated",
    )
    command.add_argument("--episodes", type=int, required=True, help="how many episodes")
    command.add_argument("--seed", type=int, default=0, help="of the schedule and of the pilots (default 0)")
    command.add_argument("--maps", choices=sorted(MAP_SETS), default="training", help="set of maps (default training)")
    command.add_argument("--out", type=Path, required=True, help="folder for the recordings, without any yet")
    command.add_argument("--workers", type=int, help="processes (default: one for each processor)")
    command.add_argument("--orientations", action="store_true", help="each map with four start orientations")
    command = add_command(
        commands,
        "recover",
        _recover,
        help="turn recordings that broke off into readable episodes; nothing is deleted or changed",
        example="copolicy-collect recover recordings/P01",
    )
    command.add_argument("folder", type=Path, help="folder of recordings; those below it are looked at too")
    command.add_argument(
        "--damaged", action="store_true", help="also recover the intact beginning of damaged finished recordings"
    )
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command; returns its exit status."""
    return run(parser(), argv)


def _simulate(arguments: argparse.Namespace) -> dict:
    return simulate(
        arguments.out,
        arguments.episodes,
        arguments.seed,
        arguments.maps,
        arguments.workers,
        arguments.orientations,
    )


def _recover(arguments: argparse.Namespace) -> dict:
    return summary(arguments.folder, recover(arguments.folder, finished=True, damaged=arguments.damaged))


if __name__ == "__main__":
    sys.exit(main())
