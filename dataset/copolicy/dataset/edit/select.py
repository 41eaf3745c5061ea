"""`select`: copies some episodes of a data set to a new data set."""

from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..exceptions import RunError
from ..files.replace_folder import finish_interrupted
from ..files.staging import new_folder, require_new
from .amend import today
from .selection import Selection
from .subset.stored_set import StoredSet, drop_notes, write_record
from .subset.writing import remaining_splits, write_subset


def select(root: Path, out: Path, selection: Selection) -> dict[str, Any]:
    """Writes the selected episodes atomically to a new data set at `out`.

    Releases, change log, findings, statistics, card and recordings of `root` describe the whole data set and are not
    copied. `meta/copolicy.json` records the source's content hash and the selection.

    Returns:
        Summary.

    Raises:
        OutputExistsError: `out` exists.
        FileFormatError: not a data set of copolicy, or a damaged one.
        RunError: no episode is selected.
    """
    require_new(out)
    finish_interrupted(root)
    source = StoredSet.read(root)
    numbers = selection.numbers(source.rows, source.column_types)
    if not numbers:
        raise RunError(f"{root}: expected at least one selected episode, found none; nothing was written")
    with new_folder(out) as partial:
        content_hash = write_subset(source, numbers, partial, remaining_splits(source.info, numbers))
        write_record(partial, selection_record(source, numbers, selection.criteria(), "copolicy-dataset select"))
    return {
        "root": str(out),
        **subset_facts(source, numbers),
        "left_out": len(source.rows) - len(numbers),
        "content_hash": content_hash,
        "made_from": source.content.hash,
        "not_carried": source.uncopied_files(),
        "next": f"copolicy-dataset check {out}; a card with copolicy-cards dataset {out}",
    }


def selection_record(source: StoredSet, numbers: list[int], criteria: dict[str, Any], command: str) -> dict[str, Any]:
    """The record of the conversion with a note on the selection."""
    selected = set(numbers)
    removed = [row["episode_uuid"] for row in source.rows if row["episode_index"] not in selected]
    note = {
        "command": command,
        "version": version("lerobot_policy_copolicy"),
        "date": today(),
        "from": {"name": source.root.resolve().name, "content_hash": source.content.hash, "episodes": len(source.rows)},
        "asked": criteria,
        "episodes": len(numbers),
    }
    record = drop_notes(source.record, removed)
    return {**record, "selections": [*record.get("selections", []), note]}


def subset_facts(source: StoredSet, numbers: list[int]) -> dict[str, Any]:
    """Counts of some episodes for the summary of a command."""
    rows = [source.rows[number] for number in numbers]
    return {
        "episodes": len(rows),
        "frames": sum(row["length"] for row in rows),
        "successes": sum(bool(row["success"]) for row in rows),
        "excluded": sum(bool(row["discarded"]) for row in rows),
        "pairs": len({row["pair_id"] for row in rows if row["pair_id"]}),
        "maps": len({row["map_id"] for row in rows if row["map_id"]}),
    }
