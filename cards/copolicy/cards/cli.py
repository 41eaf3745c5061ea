"""`copolicy-cards`: what a data set or a model tells its readers."""

from collections.abc import Sequence

from copolicy.dataset.command_line.commands import command_parser, run

from .commands import add_dataset_command, add_model_command
from .report import add_report_command


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-cards`."""
    parser, commands = command_parser("copolicy-cards", "Describe a data set or a model from its own files.")
    add_dataset_command(commands)
    add_model_command(commands)
    add_report_command(commands)
    return run(parser, argv)
