"""`copolicy-collect`: everything that makes recordings."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.commandline import add_command, command_parser, run
from copolicy.dataset.task import MAP_SETS

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


if __name__ == "__main__":
    sys.exit(main())
