"""The README of a data set without a card: the two configurations that `datasets.load_dataset` needs.

`copolicy-cards dataset` overwrites this file without `--overwrite`, and `publish` refuses it as a card.
"""

from collections.abc import Iterable
from pathlib import Path

from .licences import licence_identifier

CONFIGS = (("default", "data/*/*.parquet"), ("episodes", "meta/episodes/*/*.parquet"))
"""Name and files of each configuration: the frames and the episodes."""

_MARKER = "<!-- minimal card of copolicy-convert; `copolicy-cards dataset` replaces it -->"


def write_minimal_card(path: Path, licences: Iterable[str | None], task: str) -> None:
    """Writes the minimal card.

    Args:
        licences: licence of each episode; written if all are the same.
        task: name of the task.
    """
    identifiers = {licence_identifier(text or "") for text in licences}
    (licence,) = identifiers if len(identifiers) == 1 else (None,)
    lines = ["---", *([f"license: {licence}"] if licence else []), "task_categories:", "- robotics", "tags:"]
    lines += ["- LeRobot", "- copolicy", "configs:"]
    for name, files in CONFIGS:
        lines += [f"- config_name: {name}", f"  data_files: {files}"]
    players = "two players who carry a table" if task == "table" else f"two players at the task {task!r}"
    text = (
        f"Frames (`default`) and episodes (`episodes`) of a LeRobot v3 data set of {players}.\n"
        "`copolicy-cards dataset` writes a card in the place of this text."
    )
    path.write_text("\n".join([*lines, "---", "", _MARKER, "", text]) + "\n", encoding="utf-8")


def is_minimal_card(path: Path) -> bool:
    """Whether the file exists and was written by `write_minimal_card`."""
    return path.is_file() and _MARKER.encode() in path.read_bytes()
