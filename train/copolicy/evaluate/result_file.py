"""Writes the result files of studies atomically."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copolicy.dataset.files.staging import replace_text


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object atomically; creates the parent folder."""
    replace_text(path, json.dumps(content, indent=1) + "\n")
