"""`copolicy-cards`: writes cards, figures and a report page from the files of a data set or a model."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command, command_parser, run
from copolicy.dataset.command_line.extras import FIGURES
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.staging import replace_text, require_new
from copolicy.dataset.publication.licences import checked_licence
from copolicy.dataset.publication.minimal_card import is_minimal_card
from copolicy.dataset.publication.repo_id import checked_repo_id, local_repo_id

from .report import add_report_command


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `copolicy-cards`."""
    parser, commands = command_parser("copolicy-cards", "Describe a data set or a model from its own files.")
    add_dataset_command(commands)
    add_model_command(commands)
    add_report_command(commands)
    return run(parser, argv)


def add_dataset_command(commands: Commands) -> None:
    """Adds the command `dataset`."""
    dataset = add_command(
        commands,
        "dataset",
        _dataset,
        "write README.md with Hub metadata, a datasheet and figures into a data set folder",
        "copolicy-cards dataset outputs/dataset --repo-id my-lab/table",
        lambda arguments: () if arguments.no_figures else FIGURES,
    )
    dataset.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot v3 data set")
    dataset.add_argument("--repo-id", help="user/name on the Hub (default: local/FOLDER)")
    dataset.add_argument("--pretty-name", help="title of the card (default: the data set's name)")
    dataset.add_argument("--no-figures", action="store_true", help="write no figures")
    dataset.add_argument(
        "--croissant",
        action="store_true",
        help="also write meta/croissant.json, Croissant 1.0 metadata as JSON-LD (needs --repo-id)",
    )
    dataset.add_argument("--overwrite", action="store_true", help="replace an existing README.md")


def add_model_command(commands: Commands) -> None:
    """Adds the command `model`."""
    model = add_command(
        commands,
        "model",
        _model,
        "write README.md with Hub metadata and results into a checkpoint folder",
        "copolicy-cards model outputs/training --eval outputs/eval/holdout.json --eval outputs/eval/unseen.json",
        FIGURES,
    )
    model.add_argument(
        "checkpoint", type=Path, metavar="CHECKPOINT", help="folder of a checkpoint or training run (last checkpoint)"
    )
    model.add_argument(
        "--eval",
        action="append",
        type=Path,
        default=[],
        metavar="FILE",
        help="result of copolicy-eval (default: the results stored with an exported policy)",
    )
    model.add_argument("--dataset", type=Path, help="folder of the training data (default: as used in training)")
    model.add_argument("--repo-id", default="local/copolicy", help="user/name on the Hub (default: local/copolicy)")
    model.add_argument("--license", help="Hub identifier of the licence of the weights (default: not stated)")
    model.add_argument("--overwrite", action="store_true", help="replace an existing README.md")


def _dataset(arguments: argparse.Namespace) -> dict[str, Any]:
    if arguments.repo_id is not None:
        checked_repo_id(arguments.repo_id)
    from copolicy.dataset.files.meta_files import CROISSANT_FILE

    from .croissant import croissant_text
    from .dataset_card import render_dataset_card
    from .facts import DatasetFacts

    facts = DatasetFacts.read(arguments.root)
    path = arguments.root / "README.md"
    require_new(path, overwrite=arguments.overwrite or is_minimal_card(path))
    if arguments.croissant and not arguments.repo_id:
        raise InvalidValueError("--repo-id", "user/name with --croissant, which states the data's location", None)
    repo_id = arguments.repo_id or local_repo_id(arguments.root)
    render_dataset_card(
        facts, repo_id, arguments.pretty_name
    )  # raises errors in the arguments before figures are drawn
    figures = []
    if not arguments.no_figures:
        from .figures import save_figures

        figures = save_figures(facts)
    summary = {"card": str(path), "figures": [figure for figure, _ in figures]}
    if arguments.croissant:
        replace_text(arguments.root / CROISSANT_FILE, croissant_text(facts, repo_id, arguments.pretty_name))
        summary["croissant"] = str(arguments.root / CROISSANT_FILE)
    replace_text(path, render_dataset_card(facts, repo_id, arguments.pretty_name, figures))
    return {**summary, "episodes": len(facts.episodes), "sources": facts.counts("source")}


def _model(arguments: argparse.Namespace) -> dict[str, Any]:
    checked_repo_id(arguments.repo_id)
    checked_licence(arguments.license or "")
    from .checkpoint_facts import CheckpointFacts
    from .model_card import render_model_card

    checkpoint = CheckpointFacts.read(arguments.checkpoint, arguments.dataset)
    path = checkpoint.folder / "README.md"
    require_new(path, overwrite=arguments.overwrite)
    evaluations = checkpoint.evaluations(arguments.eval)
    replace_text(path, render_model_card(checkpoint, evaluations, arguments.repo_id, arguments.license))
    sources = checkpoint.data.sources or "not stated: the data set was not found"
    return {"card": str(path), "evaluations": len(evaluations), "trained_on": sources}
