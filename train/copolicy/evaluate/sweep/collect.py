"""The table of a sweep: a row a task, and means over the seeds of each method."""

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.files.staging import replace_json, replace_text
from copolicy.dataset.scenarios import base_name

from ..comparison.paired import BOOTSTRAP, between_runs, clustered_mean
from ..markdown_table import estimate_text, markdown_table
from .determinants import digest
from .plan import COPLANNING, NAME, PLAN_FILE, RECORDED, TABLES

LABEL = (
    "Simulated: in co-planning both players act on one sampled plan, else a simulated partner sits at the human's "
    "seat; no person took part in the evaluation"
)

MEASURES = {
    "success": ("success, %", 100, 1),
    "time_s": ("time of successes, s", 1, 1),
    "interaction_force": ("interaction force", 1, 3),
    "robot_share": ("robot's share of work", 1, 2),
    "deadlock_s": ("stand-still, s", 1, 1),
}
"""Label, factor and decimals of each measure, by its name."""

_COLUMNS = {"interaction_force": "interaction_mean"}  # of an episode's row, where the name is another

DEFINITIONS = {
    "unit of analysis": "sweep.csv: the map (episodes of a map, such as its start orientations, are drawn together); "
    "means over seeds: the training run",
    "±": "standard deviation between the training seeds / sqrt(number of seeds); of a single training (one seed): "
    "standard error over maps, which does not cover the choice of the training seed",
    "standard_error": f"in sweep.csv of one training run: {BOOTSTRAP}",
    "success": "proportion of episodes that end in a success",
    "time_s": "simulated time of successful episodes",
    "interaction_force": "mean over episodes of the mean magnitude of what the task measures",
    "robot_share": "proportion of both players' positive work that the robot does; only with a partner",
    "deadlock_s": "time of an episode in stand-stills of a second or more; only with a partner",
    "planning_ms": "median wall time of one call of the policy for all running episodes of the task",
    "wall_s": "wall time of the task, with loading the policy",
    "episodes_sha256": "of what determines the episodes and of their rows; equal for equal results, whatever the "
    "workers and the executor",
    RECORDED: "the recorded starts of a replay",
}


class _PlanEntry(TypedDict):
    method: str
    run: str
    maps: str
    partner: str
    seed: int | None
    file: str
    determined_by_sha256: str


class _Plan(TypedDict):
    tasks: list[_PlanEntry]
    overlap: dict[str, Any]


class _Sweep(TypedDict):
    method: str
    wall_s: float
    episodes_sha256: str
    determined_by: dict[str, Any]


class _Result(TypedDict):
    """The parts of a task's result that the table shows."""

    study: str
    policy: dict[str, Any]
    summary: dict[str, Any]
    sweep: _Sweep
    episodes: list[dict[str, Any]]


def collect(out: Path) -> dict[str, Any]:
    """Writes `sweep.csv`, `.md` and `.json` of the finished tasks of the last call; the JSON is returned.

    Raises:
        FileFormatError: the folder has no plan, or a result is not of the plan.
    """
    plan = read_json(out / PLAN_FILE, _Plan, "the plan of a sweep (copolicy-eval sweep)")
    rows, missing = [], []
    for entry in plan["tasks"]:
        path = out / entry["file"]
        name = {key: entry[key] for key in ("method", "run", "maps", "partner")}
        if path.exists():
            rows.append(_row(path, entry, name))
        else:
            missing.append(name)
    table = {
        "study": NAME,
        "label": LABEL,
        "definitions": DEFINITIONS,
        **({"overlap": plan["overlap"]} if plan["overlap"] else {}),
        "groups": _groups(rows),
        "tasks": rows,
        "missing": missing,
        "results_sha256": digest([row["episodes_sha256"] for row in rows]),
    }
    texts = dict(zip(TABLES[1:], (markdown(table), csv_text(rows)), strict=True))
    for name, text in texts.items():
        replace_text(out / name, text)
    replace_json(out / TABLES[0], table, indent=1)  # last, so that an existing table is complete
    return table


def _row(path: Path, entry: _PlanEntry, name: Mapping[str, str]) -> dict[str, Any]:
    result = read_json(path, _Result, "the result of a task of a sweep")
    if digest(result["sweep"]["determined_by"]) != entry["determined_by_sha256"]:
        raise FileFormatError(path, "the settings of the last call of this sweep", "others")
    episodes, summary = result["episodes"], result["summary"]
    if not episodes:
        raise FileFormatError(path, "at least one episode", "none")
    maps = [base_name(str(episode["map_id"])) for episode in episodes]
    measured = {measure: clustered_mean(_values(episodes, measure), maps) for measure in MEASURES}
    return {
        **name,
        "seed": entry["seed"],
        "study": result["study"],
        "label": "simulated",
        "episodes": len(episodes),
        "map_count": len(set(maps)),
        **{
            key: value
            for measure, found in measured.items()
            for key, value in ((measure, found["mean"]), (f"{measure}_standard_error", found["standard_error"]))
        },
        "planning_ms": (summary.get("planning_ms_per_call") or {}).get("p50"),
        "wall_s": result["sweep"]["wall_s"],
        "weights_sha256": result["policy"]["weights_sha256"],
        "episodes_sha256": result["sweep"]["episodes_sha256"],
        "file": entry["file"],
    }


def _values(episodes: Sequence[Mapping[str, Any]], measure: str) -> np.ndarray:
    column = _COLUMNS.get(measure, measure)
    counted = [measure != "time_s" or episode["success"] for episode in episodes]
    found = [episode.get(column) if counts else None for episode, counts in zip(episodes, counted, strict=True)]
    return np.array([math.nan if value is None else float(value) for value in found])


def _groups(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The runs of each method on each map set with each partner."""
    groups: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in sorted(rows, key=_place(rows)):
        groups.setdefault((row["maps"], row["partner"], row["method"]), []).append(row)
    return [
        {
            "maps": maps,
            "partner": partner,
            "method": method,
            "seeds": len(members),
            "episodes": sum(row["episodes"] for row in members),
            **{measure: _over_runs(members, measure) for measure in (*MEASURES, "planning_ms")},
        }
        for (maps, partner, method), members in groups.items()
    ]


def _place(rows: Sequence[Mapping[str, Any]]) -> Callable[[Mapping[str, Any]], tuple[int, ...]]:
    """Sorts by map set, partner and method, each in the order of the first row that has it."""
    orders = [
        {value: k for k, value in enumerate(dict.fromkeys(row[name] for row in rows))}
        for name in ("maps", "partner", "method")
    ]
    names = ("maps", "partner", "method")
    return lambda row: tuple(order[row[name]] for order, name in zip(orders, names, strict=True))


def _over_runs(members: Sequence[Mapping[str, Any]], measure: str) -> dict[str, Any] | None:
    """Mean over training runs with its standard error; None without a value."""
    values = [row[measure] for row in members if row[measure] is not None]
    if not values:
        return None
    found, source = between_runs(values), "between runs"
    if len(values) == 1:
        found["standard_error"] = members[0].get(f"{measure}_standard_error") if len(members) == 1 else None
        source = "over maps, one run"
    return {
        "mean": found["mean"],
        "standard_error": found["standard_error"],
        "standard_error_of": source,
        "runs": len(values),
    }  # fmt: skip


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line a task; proportions are fractions, times seconds."""
    buffer = io.StringIO()
    names = list(rows[0]) if rows else []
    writer = csv.DictWriter(buffer, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def markdown(table: Mapping[str, Any]) -> str:
    """A table for each map set and study, the definitions, and what is missing."""
    groups = table["groups"]
    text = ["# Sweep", f"{table['label']}. Mean over training seeds ± standard error; unit of analysis: training run."]
    for maps, partner in dict.fromkeys((group["maps"], group["partner"]) for group in groups):
        members = [group for group in groups if (group["maps"], group["partner"]) == (maps, partner)]
        shown = [measure for measure in MEASURES if any(group[measure] for group in members)]
        heads = ["method", "seeds", "episodes", *(MEASURES[measure][0] for measure in shown), "planning, ms a call"]
        lines = [
            [
                group["method"],
                str(group["seeds"]),
                str(group["episodes"]),
                *(estimate_text(group[measure], *MEASURES[measure][1:]) for measure in shown),
                "none" if group["planning_ms"] is None else f"{group['planning_ms']['mean']:.2f}",
            ]
            for group in members
        ]
        study = partner if partner == COPLANNING else f"partner {partner}"
        text += [f"## {maps}: {study}", markdown_table(heads, lines)]
    if table["missing"]:
        lines = [f"- {' / '.join(entry.values())}" for entry in table["missing"]]
        text += [f"## Missing: {len(lines)} tasks", "\n".join(lines)]
    if shared := table.get("overlap", {}).get("shared"):
        lines = [f"- {robot}: {', '.join(partners)}" for robot, partners in shared.items()]
        text += ["## Robots and partners that learned from a common pair", "\n".join(lines)]
    text += ["## Definitions", "\n".join(f"- {name}: {note}." for name, note in table["definitions"].items())]
    return "\n\n".join(text) + "\n"
