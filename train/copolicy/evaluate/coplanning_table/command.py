"""`copolicy-eval table coplanning`."""

import argparse
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.command_line.extras import FIGURES, POLICIES
from copolicy.dataset.command_line.flag_numbers import add_whole_number
from copolicy.dataset.exceptions import OutputExistsError
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.staging import replace_json, replace_text
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import PairTask

from ..study_flags import add_world_flags, study_protocol

if TYPE_CHECKING:
    from .training_runs import TrainedMethod

STUDY = "coplanning table"
"""Name of the study in `table.json`."""

_MAPS = ("holdout", "unseen")
_NAME, _FILES = "table", (".json", ".md", ".csv", ".png")
_LABEL = "Simulated pairs: both players act on one sampled plan, in simulation; no person took part in the evaluation"
_NOTE = "Methods differ in what they were trained on; see the columns data, steps and samples."
_EXAMPLE = (
    "copolicy-eval table coplanning --runs CoDP-H=outputs/codp-h BC=outputs/bc --out outputs/table\n"
    "  Each folder has the runs of one method: codp-h/seed_0/training, codp-h/seed_1/training, ..."
)


def add_coplanning_table_command(steps: Commands) -> None:
    """Adds `table coplanning` to the commands of `copolicy-eval`."""
    command = add_command(
        steps,
        "coplanning",
        _coplanning,
        "the co-planning table: success of several methods over training seeds; evaluates runs that have no result",
        _EXAMPLE,
        (*POLICIES, *FIGURES),
    )
    command.add_argument(
        "--runs",
        required=True,
        nargs="+",
        metavar="[NAME=]DIR",
        help="folder with the runs of one method, one per training seed, or a single run; the first method is the "
        "reference (default name: policy type and preset)",
    )
    command.add_argument(
        "--out", required=True, type=Path, metavar="FOLDER", help="folder for table.md, .csv, .png, .json"
    )
    command.add_argument(
        "--maps",
        nargs="+",
        metavar="NAME|FILE[#SPLIT]",
        help=f"map sets of the table (default: {' and '.join(_MAPS)}, or the first set of a task without them)",
    )
    command.add_argument("--orientations", action="store_true", help="run each map with four start orientations")
    add_whole_number(command, "--repeats", "episodes per map (default: 1)", 1, 1, 10_000)
    add_whole_number(command, "--limit", "use only the first N maps; recorded in the results")
    command.add_argument("--device", default="cpu", help="default: cpu")
    add_world_flags(command, n_action_steps=8)
    # Each method is evaluated with the inference settings of its checkpoints.
    command.set_defaults(sampler=None, backend=None, num_inference_steps=None, initial_noise_scale=None, code=None)


def _coplanning(arguments: argparse.Namespace) -> dict[str, Any]:
    _require_own_folder(arguments.out)
    # Imported here so that `--help` and argument errors do not wait for torch.
    from .evaluations import Evaluator
    from .training_runs import read_trained_methods

    methods = read_trained_methods(arguments.runs)
    for method in methods:
        for run in method.runs:
            if run.unfinished:
                logging.warning("warning: %s: the training is not finished (%s)", run.folder, run.unfinished)
    arguments.n_action_steps = arguments.n_action_steps or arguments.default_n_action_steps
    protocol = study_protocol(arguments, [(method.name, method.runs[0].conditions) for method in methods])
    map_sets = _map_sets(protocol.task, arguments)
    evaluator = Evaluator(arguments, protocol, map_sets, arguments.out)
    results = evaluator.results(methods)
    table = _table(methods, results, protocol.task, evaluator.left_out)
    table["settings"]["n_action_steps"] = arguments.n_action_steps
    _write(table, arguments.out)
    return {
        "success": {
            row["method"]: {
                maps: f"{100 * cell['mean']:.1f} ± {100 * cell['standard_error']:.1f} % of {cell['episodes']}"
                for maps, cell in row["maps"].items()
            }
            for row in table["methods"]
        },
        "new_evaluations": evaluator.evaluated,
        "left_out": len(evaluator.left_out),
        "table": str(arguments.out / f"{_NAME}.md"),
    }


def _map_sets(task: PairTask, arguments: argparse.Namespace) -> list[ScenarioSet]:
    names = arguments.maps or [name for name in _MAPS if name in task.scenario_sets] or [next(iter(task.scenario_sets))]
    chosen = [task.scenario_set(name) for name in dict.fromkeys(names)]
    return [task.turned(scenario_set) for scenario_set in chosen] if arguments.orientations else chosen


def _table(methods: "list[TrainedMethod]", results: list, task: PairTask, left_out: list[str]) -> dict[str, Any]:
    from .rows import DEFINITIONS, published_rows, reference_difference, table_row

    rows, read = zip(
        *(table_row(method, runs, task.studies) for method, runs in zip(methods, results, strict=True)), strict=True
    )
    maps = list(results[0][0])
    first = next(iter(results[0][0].values())).result
    settings = {
        name: value
        for name, value in first["settings"].items()
        if name not in ("maps", "map_set", "actions_per_plan", "fps", "hold", "device", "map_count", "unseen")
    }
    counts = {name: results[0][0][name].result["settings"]["map_count"] for name in maps}
    map_sets = {name: results[0][0][name].result["settings"]["map_set"] for name in maps}
    settings |= {"map_sets": map_sets, "map_counts": counts}
    settings["map_count_text"] = ", ".join(f"{name}: {count} maps" for name, count in counts.items())
    measured = all(run.measures_interaction for run in read[0][maps[0]])
    not_measured = {} if measured else {"interaction": task.missing("interaction measure")}
    force = task.studies.definitions.get("interaction_force")
    definitions = {**DEFINITIONS, "interaction": f"{force}; {DEFINITIONS['interaction']}" if force else ""}
    return {
        "study": STUDY,
        "label": _LABEL,
        "note": _NOTE,
        "maps": maps,
        "settings": settings,
        "methods": list(rows),
        "differences": [
            {"reference": rows[0]["method"], "method": row["method"], "maps": reference_difference(read[0], runs)}
            for row, runs in zip(rows[1:], read[1:], strict=True)
        ],
        "published": published_rows(task.studies),
        "published_source": task.studies.published_source,
        "definitions": {name: text for name, text in definitions.items() if text and name not in not_measured},
        **({"not_measured": not_measured} if not_measured else {}),
        "left_out": left_out,
    }


def _write(table: dict[str, Any], out: Path) -> None:
    from .figure import save_table_figure
    from .text import csv_text, markdown

    out.mkdir(parents=True, exist_ok=True)
    replace_json(out / f"{_NAME}.json", table, indent=1)  # first: it marks the other files as a table's
    save_table_figure(table, out / f"{_NAME}.png")
    replace_text(out / f"{_NAME}.csv", csv_text(table))
    replace_text(out / f"{_NAME}.md", markdown(table))


def _require_own_folder(out: Path) -> None:
    """Refuses a folder with files of these names that are not an earlier table, which is written anew."""
    json_path = out / f"{_NAME}.json"
    earlier = read_optional_json(json_path, dict[str, Any], "an earlier table") or {}
    for suffix in _FILES:
        path = out / f"{_NAME}{suffix}"
        if path.exists() and earlier.get("study") != STUDY:
            raise OutputExistsError(path)
