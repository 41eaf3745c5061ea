"""Puts template, style, script and data together into one page that loads nothing."""

import json
import math
import re
from html import escape
from importlib.resources import files
from typing import Any

SCRIPTS = (
    "elements.js",
    "palette.js",
    "data.js",
    "scene.js",
    "filters.js",
    "overview.js",
    "route_statistics.js",
    "trajectories.js",
    "heatmaps.js",
    "pairs.js",
    "timing.js",
    "findings.js",
    "statistics.js",
    "episodes.js",
    "player.js",
    "main.js",
)
"""In the order in which they run; they share one scope."""


def render_page(payload: dict[str, Any]) -> str:
    """The text of the page."""
    folder = files(__package__)
    script = "\n".join(folder.joinpath(name).read_text(encoding="utf-8") for name in SCRIPTS)
    # Inside a script element only "</" and "<!--" could end the data; JSON may spell "<" as an escape.
    data = json.dumps(_plain(payload), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    parts = {
        "{{title}}": escape(payload["title"]),
        "{{style}}": folder.joinpath("report.css").read_text(encoding="utf-8"),
        "{{script}}": f'(() => {{\n"use strict";\n{script}\n}})();',
        "{{data}}": data,
    }
    template = folder.joinpath("template.html").read_text(encoding="utf-8")
    # One pass: what is put in is not searched again.
    return re.sub(r"\{\{\w+\}\}", lambda match: parts[match[0]], template)


def _plain(value: Any) -> Any:
    """The value without numbers that JSON has no word for, which JSON written by Python may contain."""
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
