"""The flag `--maps` of every command that carries on maps."""

import argparse


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
