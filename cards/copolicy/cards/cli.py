"""`copolicy-cards`: what a data set or a model tells its readers."""

import argparse
import os
from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.commandline import add_command, command_parser, run
from copolicy.dataset.exceptions import OutputExistsError


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-cards`."""
    parser, commands = command_parser("copolicy-cards", "Describe a data set from its own metadata.")
    dataset = add_command(
        commands,
        "dataset",
        _dataset,
        "write README.md with Hub metadata into a data set folder",
        "copolicy-cards dataset outputs/dataset --repo-id my-lab/table",
    )
    dataset.add_argument("root", type=Path, help="folder of a LeRobot v3 data set")
    dataset.add_argument("--repo-id", help="user/name on the Hub (default: local/FOLDER)")
    dataset.add_argument("--pretty-name", help="title of the card (default: the data set's name)")
    dataset.add_argument("--overwrite", action="store_true", help="replace an existing README.md")
    return run(parser, argv)


def _dataset(arguments: argparse.Namespace) -> dict:
    from .dataset_card import render
    from .facts import DatasetFacts

    facts = DatasetFacts.read(arguments.root)
    path = arguments.root / "README.md"
    if path.exists() and not arguments.overwrite:
        raise OutputExistsError(path)
    text = render(facts, arguments.repo_id or f"local/{arguments.root.resolve().name}", arguments.pretty_name)
    partial = path.with_suffix(".md.part")
    partial.write_text(text)
    os.replace(partial, path)
    return {"card": str(path), "episodes": len(facts.episodes), "sources": facts.counts("source")}
