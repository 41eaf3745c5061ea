"""The command `copolicy-convert merge`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import DATASETS
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.publication.repo_id import checked_repo_id


def add_merge_command(commands: Commands) -> None:
    """Adds `merge`."""
    parser = add_command(
        commands, "merge", _merge, "merge LeRobot data sets of this project, such as those of two labs",
        "copolicy-convert merge lab_a/table lab_b/table --prefix-people kth tudelft --out both --repo-id me/both",
        DATASETS,
    )  # fmt: skip
    parser.add_argument("roots", nargs="+", type=Path, metavar="PATH", help="folders of data sets, in this order")
    parser.add_argument("--out", type=Path, required=True, metavar="OUT", help="the new folder; must not exist")
    parser.add_argument("--repo-id", required=True, metavar="USER/NAME", help="the data set's name on the Hub")
    people = parser.add_mutually_exclusive_group()
    people.add_argument(
        "--prefix-people", nargs="+", metavar="LAB",
        help="one prefix per data set for its pseudonyms, session and consent ids: P01 becomes LAB-P01",
    )  # fmt: skip
    people.add_argument(
        "--same-people", action="store_true",
        help="a pseudonym that occurs in several data sets is the same person (sessions of one lab)",
    )  # fmt: skip


def _merge(arguments: argparse.Namespace) -> dict[str, Any]:
    from .merge_datasets import merge_datasets

    if len(arguments.roots) < 2:
        raise InvalidValueError("PATH", "at least two data sets", len(arguments.roots))
    return merge_datasets(
        arguments.roots,
        arguments.out,
        checked_repo_id(arguments.repo_id),
        arguments.prefix_people,
        arguments.same_people,
    )
