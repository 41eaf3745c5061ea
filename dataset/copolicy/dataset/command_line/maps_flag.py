"""The flags `--maps` and `--task` of every command that acts in scenarios."""

import argparse

from ..task import TABLE, PairTask


def add_task_flag(command: argparse.ArgumentParser, given: bool = True) -> None:
    """Adds `--task NAME`; without `given` its value is None where nobody gave it."""
    default = TABLE if given else None
    command.add_argument("--task", default=default, metavar="NAME", help=f"task that is installed (default: {TABLE})")


def set_name(task: PairTask, given: str | None, default: str) -> str:
    """The value of `--maps`, or its default; the first set of a task that has none of that name."""
    return given or (default if default in task.scenario_sets else next(iter(task.scenario_sets)))


def add_maps_flag(command: argparse.ArgumentParser, default: str, dest: str = "maps", given: bool = True) -> None:
    """Adds `--maps NAME|FILE[#SPLIT]`, which `PairTask.scenario_set` reads.

    Args:
        default: name of the set that the command takes where the flag is not given.
        given: the flag's value is then this name; otherwise it is None and the command sees that nobody gave it.
    """
    command.add_argument(
        "--maps",
        dest=dest,
        default=default if given else None,
        metavar="NAME|FILE[#SPLIT]",
        help="set of maps of the task, such as training, holdout or unseen; a file of one's own maps "
        f"(`copolicy-collect maps`), or one of its splits (default: {default})",
    )
