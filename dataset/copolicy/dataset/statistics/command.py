"""`copolicy-dataset stats`: writes the statistics of a data set."""

import argparse
from pathlib import Path
from typing import Any

from ..command_line.commands import Commands, add_command
from ..command_line.flag_numbers import seed
from ..episode import Source
from ..exceptions import FileFormatError, InvalidValueError
from ..files.meta_files import STATISTICS_FILE
from ..files.staging import replace_json


def add_stats_command(commands: Commands) -> None:
    """Adds `stats`."""
    summary_text = "compute statistics with intervals and null distributions, into meta/copolicy_stats.json"
    parser = add_command(commands, "stats", _stats, summary_text, "copolicy-dataset stats datasets/table")
    parser.add_argument("path", type=Path, metavar="PATH", help="folder of a LeRobot v3 data set")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write to this file instead of into the data set")
    parser.add_argument("--seed", type=seed(), default=0, help="seed of all random draws (default: %(default)s)")
    parser.add_argument(
        "--source", choices=Source.__args__, default=None, help="use only episodes of this source (needs --out)"
    )


def _stats(arguments: argparse.Namespace) -> dict[str, Any]:
    from .compute import dataset_statistics

    if arguments.seed < 0:
        raise InvalidValueError("--seed", "at least 0", arguments.seed)
    if arguments.source and arguments.out is None:
        raise InvalidValueError("--out", "a file, since statistics of one source are not those of the data set", None)
    target = arguments.out or arguments.path / STATISTICS_FILE
    if target.is_dir():
        raise FileFormatError(target, "a file to write", "a folder")
    document = dataset_statistics(arguments.path, arguments.source, arguments.seed)
    replace_json(target, document, allow_nan=False)
    return {"written": str(target), **(document if arguments.json else summary(document))}


def summary(document: dict[str, Any]) -> dict[str, Any]:
    """The statistics as one readable line each: value, interval, unit, and null distribution."""
    lines: dict[str, Any] = {"definition_version": document["definition_version"]}
    lines["dataset"] = {
        **{name: value for name, value in document["dataset"].items() if isinstance(value, int)},
        "sources": "; ".join(
            f"{name} ({count}): {document['dataset']['source_labels'][name]}"
            for name, count in document["dataset"]["sources"].items()
        ),
    }
    if document["dataset"]["left_out"]:
        lines["dataset"]["left_out"] = ", ".join(f"{n} {name}" for name, n in document["dataset"]["left_out"].items())
    for family, estimates in document["statistics"].items():
        lines[family] = {name: _line(estimate) for name, estimate in estimates.items()}
        for name, entry in estimates.items():
            if name == "route_entropy_pooled" and "details" in entry:
                lines[family].pop(name)
                lines[family] |= {f"{name}_{size}": _entropy_line(pooled) for size, pooled in entry["details"].items()}
    if "human_reference" in document:
        routes = document["human_reference"]["routes"]
        pooled = {f"route_entropy_pooled_{size}": _entropy_line(pooled) for size, pooled in routes.items()}
        lines["people, for comparison"] = pooled
    return lines


def _line(estimate: dict[str, Any]) -> str:
    if estimate["value"] is None:
        return f"- ({estimate.get('note', 'not computed')})"
    text = f"{estimate['value']:.4g}"
    if estimate["interval"] is not None and None not in estimate["interval"]:
        text += " [{:.3g}, {:.3g}]".format(*estimate["interval"])
    if estimate["unit"] != "1":
        text += f" {estimate['unit']}"
    if "null" in estimate:
        null = estimate["null"]
        text += f"; null {null['mean']:.3g} [{null['low']:.3g}, {null['high']:.3g}], p = {null['p']:.2g}"
    details = estimate.get("details", {})
    if "reading" in details:
        other_bits = details["mirrored_bits" if details["reading"] == "as labelled" else "as_labelled_bits"]
        text += f"; labels {details['reading']}, the other reading {other_bits:.3g}"
    return text


def _entropy_line(entry: dict[str, Any]) -> str:
    if entry["entropy_bits"] is None:
        return f"- ({entry['note']})"
    low, high = entry["interval"]
    return (
        f"{entry['entropy_bits']:.3g} [{low:.3g}, {high:.3g}] of {entry['obstacles']} bits, plug-in "
        f"{entry['plug_in_bits']:.3g}, n = {entry['episodes']}"
    )
