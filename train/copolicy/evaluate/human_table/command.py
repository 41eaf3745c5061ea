"""`copolicy-eval table human`."""

import argparse
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.staging import replace_json, replace_text

from ..human_study.summarise_command import add_ratings_flag, read_study

_NAME, _FILES = "table", (".json", ".md", ".csv")


def add_human_table_command(steps: Commands) -> None:
    """Adds `table human` to the commands of `copolicy-eval`."""
    command = add_command(
        steps,
        "human",
        _human,
        "the tables of the studies with people: success, times, force and planning of each robot; success by set-up; "
        "questionnaires",
        "copolicy-eval table human --recordings study/recordings --plan study/plan.json --out study/table",
    )
    command.add_argument(
        "--recordings",
        required=True,
        nargs="+",
        type=Path,
        metavar="DIR",
        help="folders of sessions of one plan, with the answers given in the window",
    )
    command.add_argument("--plan", required=True, type=Path, help="plan of the study, which names the robots")
    add_ratings_flag(command)
    command.add_argument("--out", required=True, type=Path, metavar="FOLDER", help="folder for table.md, .csv, .json")


def _human(arguments: argparse.Namespace) -> dict[str, Any]:
    from ..human_study.summary import mean_text
    from .tables import STUDY, human_table
    from .text import csv_text, markdown

    _require_own_folder(arguments.out, STUDY)
    plan, rows, left_out, ratings = read_study(arguments.recordings, arguments.plan, arguments.ratings)
    assert plan is not None, "the flag is required"
    table = human_table(rows, ratings, plan, left_out)
    table |= {"rows": rows, "answers": ratings}
    arguments.out.mkdir(parents=True, exist_ok=True)
    replace_json(arguments.out / f"{_NAME}.json", table, indent=1)  # first: it marks the other files as a table's
    replace_text(arguments.out / f"{_NAME}.csv", csv_text(table))
    replace_text(arguments.out / f"{_NAME}.md", markdown(table))
    return {
        "label": table["label"],
        "unit_of_analysis": table["unit_of_analysis"],
        "episodes": f"{len(rows)} of {table['planned']} planned",
        "left_out": left_out,
        "success": {row["robot"]: mean_text(row["success"], 100, 1, " %") for row in table["robots"]},
        "table": str(arguments.out / f"{_NAME}.md"),
    }


def _require_own_folder(out: Path, study: str) -> None:
    """Refuses a file, and a folder with files of these names that are not an earlier table, which is written anew."""
    if out.exists() and not out.is_dir():
        raise FileFormatError(out, "a folder for the tables", describe_path(out))
    earlier = read_optional_json(out / f"{_NAME}.json", dict[str, Any], "an earlier table") or {}
    for suffix in _FILES:
        path = out / f"{_NAME}{suffix}"
        if path.exists() and earlier.get("study") != study:
            raise OutputExistsError(path)
