"""`copolicy-cards report`: renders template, style, scripts and data to one self-contained HTML page."""

import argparse
import json
import math
import re
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line.commands import Commands, add_command
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.meta_files import CHECK_FILE
from copolicy.dataset.files.staging import replace_text, require_new
from copolicy.dataset.outline_figure import BLUE, GREEN, ORANGE, SKY

from ..artefacts import StoredFindings, stored_findings, stored_statistics

REPORT_NAME = "report.html"

SCRIPTS = (
    "elements.js", "data.js", "palette.js", "scene.js", "filters.js", "overview.js",
    "route_statistics.js", "trajectories.js", "heatmaps.js", "pairs.js", "timing.js",
    "findings.js", "statistics.js", "episodes.js", "player.js", "main.js",
)  # fmt: skip
"""Scripts in the order of execution; they share one scope."""

_PALETTE = " ".join(
    f"--{name}: {paint};" for name, paint in (("blue", BLUE), ("orange", ORANGE), ("green", GREEN), ("sky", SKY))
)


def add_report_command(commands: Commands) -> None:
    """Adds the command `report`."""
    report = add_command(
        commands,
        "report",
        _report,
        "write one HTML page about a data set: paths, heat maps, pairs, findings, and a player for every episode",
        "copolicy-cards report outputs/dataset",
    )
    report.add_argument("root", type=Path, metavar="PATH", help="folder of a LeRobot v3 data set")
    report.add_argument("--out", type=Path, help=f"file of the page (default: {REPORT_NAME} in the data set's folder)")
    report.add_argument("--title", help="heading of the page (default: the folder's name)")
    report.add_argument(
        "--findings",
        type=Path,
        help=f"output of `copolicy-dataset check --json` (default: {CHECK_FILE} in the data set)",
    )
    report.add_argument(
        "--figures",
        type=Path,
        metavar="FOLDER",
        help="also show the figures in a folder of `copolicy-eval figures`, as they are",
    )
    report.add_argument("--overwrite", action="store_true", help="replace an existing page")


def _report(arguments: argparse.Namespace) -> dict[str, Any]:
    from ..facts import DatasetFacts
    from .figures_section import figures_section
    from .payload import build_payload

    path = arguments.out or arguments.root / REPORT_NAME
    facts = DatasetFacts.read(arguments.root)
    require_new(path, overwrite=arguments.overwrite)
    findings = stored_findings(arguments.root, arguments.findings)
    if findings is None and arguments.findings is not None:
        raise FileFormatError(arguments.findings, "a file with the output of `copolicy-dataset check --json`", "none")
    statistics = stored_statistics(arguments.root)
    payload = build_payload(facts, arguments.title or arguments.root.resolve().name, findings, statistics)
    figures = "" if arguments.figures is None else figures_section(arguments.figures, facts.task.spec.name)
    text = render_page(payload, figures)
    replace_text(path, text)
    return {
        "report": str(path),
        "episodes": len(facts.episodes),
        "megabytes": round(len(text.encode()) / 1e6, 2),
        "frames_shown": "all" if payload["frame_step"] == 1 else f"one in {payload['frame_step']}",
        "findings": _findings_status(findings),
        "statistics": "copolicy-dataset stats was not run" if payload["statistics"] is None else "shown",
    }


def _findings_status(findings: StoredFindings | None) -> str:
    if findings is None:
        return "copolicy-dataset check was not run"
    if findings.validity.state == "current":
        return "shown"
    return f"shown as {findings.validity.state}: {findings.validity.reason}"


def render_page(payload: dict[str, Any], figures: str = "") -> str:
    """Renders the HTML of the page.

    Args:
        figures: HTML of the section with figures.
    """
    folder = files(__package__)
    script = "\n".join(folder.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    # "</" or "<!--" would end the script element: "<" is written as a JSON escape.
    data = json.dumps(_json_value(payload), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    parts = {name: escape(text) for name, text in _texts(payload).items()} | {
        "style": f":root {{ {_PALETTE} }}\n{folder.joinpath('report.css').read_text(encoding='utf-8')}",
        "script": f'(() => {{\n"use strict";\n{script}\n}})();',
        "data": data,
        "figures": figures,
    }
    template = folder.joinpath("template.html").read_text(encoding="utf-8")
    # One pass: inserted text is not substituted again.
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def _texts(payload: dict[str, Any]) -> dict[str, str]:
    """Texts of the template in the words of the task."""
    words, missing, outline = payload["words"], payload["left_out"], payload["outline"]
    labels, end = words["labels"][1], f"an end {words['failure'].removeprefix('ended ')}"
    coloured = "" if "labels" in missing else f", coloured by {words['label_class']}{labels and f': {labels}'}"
    starts = any(shape["role"] == "start" for scene in payload["scenes"] for shape in scene["shapes"])
    marks = f"A circle marks the start, a cross {end}." if starts else f"A cross marks {end}."
    phrases = {name: words[name] for name in ("body", "interaction_unit", "scenario", "scenarios", "scene")}
    interaction = words["interaction"].capitalize()
    return {
        **phrases,
        "title": payload["title"],
        "labels": f"{words['label'].capitalize()}s",
        "paths": f"{words['body']}{coloured}. {marks}",
        "unit": outline["unit"] if outline else "",
        "Interaction": interaction,
        "interaction_note": "" if "interaction" in missing else words["interaction_note"],
        "graph": "Both players' forces" if "interaction" in missing else f"{interaction} and both players' forces",
    }


def _json_value(value: Any) -> Any:
    """Replaces NaN and infinity, which JSON written by Python may contain, by null."""
    if isinstance(value, dict):
        return {str(key): _json_value(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_json_value(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
