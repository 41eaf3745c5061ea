"""`copolicy-dataset publish` and `copolicy-dataset pull`."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..command_line.commands import Commands, add_command


def add_publish_command(commands: Commands) -> None:
    """Adds `publish`."""
    parser = add_command(
        commands,
        "publish",
        _publish,
        "check a released data set, upload it in one commit and tag it; uses the token of `hf auth login` or HF_TOKEN",
        "copolicy-dataset publish outputs/dataset --repo-id my-lab/table --private",
    )
    parser.add_argument("root", type=Path, metavar="PATH", help="folder of a released LeRobot v3 data set with a card")
    parser.add_argument("--repo-id", required=True, metavar="U/N", help="user/name on the Hub")
    parser.add_argument("--private", action="store_true", help="create a private repository; refuse a public one")
    parser.add_argument("--raw", type=Path, metavar="DIR", help="also upload the episodes' recordings from DIR")
    parser.add_argument(
        "--with-excluded", action="store_true", help="also upload excluded episodes; by default they are refused"
    )


def add_pull_command(commands: Commands) -> None:
    """Adds `pull`."""
    parser = add_command(
        commands,
        "pull",
        _pull,
        "download a data version and verify its files and content hash",
        "copolicy-dataset pull my-lab/table@data-1.0.0 --out outputs/table",
    )
    parser.add_argument("name", metavar="U/N[@REVISION]", help="data set on the Hub (default: its newest data version)")
    parser.add_argument("--out", type=Path, required=True, metavar="OUT", help="new folder")
    parser.add_argument("--with-raw", action="store_true", help="also download the recordings, if published")


def _publish(arguments: argparse.Namespace) -> dict[str, Any]:
    from .publish import publish

    return asdict(publish(arguments.root, arguments.repo_id, arguments.private, arguments.raw, arguments.with_excluded))


def _pull(arguments: argparse.Namespace) -> dict[str, Any]:
    from .pull import pull

    name, _, revision = arguments.name.partition("@")
    return asdict(pull(name, revision or None, arguments.out, arguments.with_raw))
