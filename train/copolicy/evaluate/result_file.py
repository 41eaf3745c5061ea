"""Result files of studies: written whole or not at all, and overwritten only when asked."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copolicy.dataset.files.staging import replace_text


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a JSON object, whole or not at all; makes the folder."""
    replace_text(path, json.dumps(content, indent=1) + "\n")
