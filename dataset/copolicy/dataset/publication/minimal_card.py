"""The README of a data set that has no card yet: what `datasets.load_dataset` needs to find its two tables, no more.

It is no card: it describes nothing, `copolicy-cards dataset` replaces it unasked, and `publish` refuses it.
"""

from collections.abc import Iterable
from pathlib import Path

from .licences import licence_identifier

CONFIGS = (("default", "data/*/*.parquet"), ("episodes", "meta/episodes/*/*.parquet"))
"""Name and files of each table: the frames, and who, what and how of each episode."""

_MARKER = "<!-- minimal card of copolicy-convert; `copolicy-cards dataset` replaces it -->"


def write_minimal_card(path: Path, licences: Iterable[str | None], task: str) -> None:
    """Writes the file.

    Args:
        licences: of the episodes; stated where all have the same one.
        task: its name.
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
    """The file is there and is what `write_minimal_card` writes, which nobody has to keep."""
    return path.is_file() and _MARKER.encode() in path.read_bytes()
