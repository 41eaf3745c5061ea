"""`copolicy-dataset`: check, measure, version and publish a data set."""

from collections.abc import Sequence

from .checks.command import add_check_command
from .command_line.commands import command_parser, run
from .edit.commands import add_amend_command, add_select_command, add_split_command, add_withdraw_command
from .lerobot_folder.exclusions import add_exclude_command
from .statistics import add_stats_command
from .transfer.commands import add_publish_command, add_pull_command
from .versions.commands import add_diff_command, add_release_command


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-dataset`."""
    parser, commands = command_parser("copolicy-dataset", "Check, measure, version and publish a data set.")
    add_check_command(commands)
    add_exclude_command(commands)
    add_select_command(commands)
    add_split_command(commands)
    add_withdraw_command(commands)
    add_amend_command(commands)
    add_stats_command(commands)
    add_release_command(commands)
    add_diff_command(commands)
    add_publish_command(commands)
    add_pull_command(commands)
    return run(parser, argv)
