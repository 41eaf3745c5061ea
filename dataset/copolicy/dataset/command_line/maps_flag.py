"""The flags `--maps` and `--task` of commands that run scenarios."""

import argparse

from ..task import TABLE, PairTask


def add_task_flag(parser: argparse.ArgumentParser, use_default: bool = True) -> None:
    """Adds `--task NAME`; without `use_default` its value is None if the flag is missing."""
    default = TABLE if use_default else None
    parser.add_argument("--task", default=default, metavar="NAME", help=f"name of an installed task (default: {TABLE})")


def map_set_name(task: PairTask, name: str | None, default: str) -> str:
    """The value of `--maps`, else the default set, else the first set of a task without a set of that name."""
    return name or (default if default in task.scenario_sets else next(iter(task.scenario_sets)))


def add_maps_flag(parser: argparse.ArgumentParser, default: str, dest: str = "maps", use_default: bool = True) -> None:
    """Adds `--maps NAME|FILE[#SPLIT]`, which `PairTask.scenario_set` reads.

    Args:
        default: name of the set that the command uses without the flag.
        use_default: use `default` as the flag's value if it is missing; otherwise the value is None.
    """
    parser.add_argument(
        "--maps",
        dest=dest,
        default=default if use_default else None,
        metavar="NAME|FILE[#SPLIT]",
        help="map set of the task, such as training, holdout or unseen; a map file (`copolicy-collect maps`), or one "
        f"split of it (default: {default})",
    )
