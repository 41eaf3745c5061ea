"""`copolicy-eval power`."""

import argparse
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.flag_numbers import add_whole_number, number, whole_number


def add_power_command(commands: Commands) -> None:
    """Adds `power` to the commands of `copolicy-eval`."""
    command = add_command(
        commands,
        "power",
        _power,
        "how many people a study of several robots needs, or the power with a number of people",
        "copolicy-eval power --robots 5 --effect 0.3\n  copolicy-eval power --robots 5 --effect 0.3 --people 6",
    )
    command.add_argument("--robots", type=whole_number("--robots", 2, 100), required=True, help="robots per person")
    for flag, default, help in (
        ("--effect", None, "partial eta squared of the robots, as from a pilot study"),
        ("--correlation", 0.5, "correlation of a person's values with two robots (default: 0.5)"),
        ("--epsilon", 1.0, "Greenhouse and Geisser's epsilon (default: 1, equal variances)"),
        ("--power", 0.8, "wanted power (default: 0.8)"),
        ("--alpha", 0.05, "level of significance (default: 0.05)"),
    ):
        bounds = number(flag, -1 if flag == "--correlation" else 0, 1)
        command.add_argument(flag, type=bounds, default=default, required=default is None, help=help)
    add_whole_number(command, "--people", "give the power with this number of people instead", None, 2, 100_000)


def _power(arguments: argparse.Namespace) -> dict[str, Any]:
    from .power import people_needed

    return people_needed(
        arguments.robots,
        arguments.effect,
        correlation=arguments.correlation,
        epsilon=arguments.epsilon,
        power=arguments.power,
        alpha=arguments.alpha,
        people=arguments.people,
    )
