"""`select`: some episodes of a data set as a data set of their own."""

from importlib.metadata import version
from pathlib import Path
from typing import Any

from ..exceptions import RunError
from ..files.replace_folder import finish_interrupted
from ..files.staging import new_folder, require_new
from .amend import today
from .selection import Selection
from .subset.stored_set import StoredSet, without_episodes, write_record
from .subset.writing import kept_splits, write_subset


def select(root: Path, out: Path, selection: Selection) -> dict[str, Any]:
    """Writes the chosen episodes as a new data set at `out`, which appears whole or not at all.

    A selection is another data set: releases, change log, findings, statistics, card and recordings of `root` are
    about the whole and stay behind. `meta/copolicy.json` tells which content it was made from and what was asked.

    Returns:
        Summary.

    Raises:
        OutputExistsError: there is something at `out`.
        FileFormatError: no data set of this project, or a damaged one.
        RunError: no episode is meant.
    """
    require_new(out)
    finish_interrupted(root)
    source = StoredSet.read(root)
    numbers = selection.numbers(source.rows, source.column_types)
    if not numbers:
        raise RunError(f"{root}: expected at least one episode that is meant, found none; nothing was written")
    with new_folder(out) as partial:
        content_hash = write_subset(source, numbers, partial, kept_splits(source.info, numbers))
        write_record(partial, selection_record(source, numbers, selection.asked(), "copolicy-dataset select"))
    return {
        "root": str(out),
        **subset_facts(source, numbers),
        "left_out": len(source.rows) - len(numbers),
        "content_hash": content_hash,
        "made_from": source.content.hash,
        "not_carried": source.left_behind(),
        "next": f"copolicy-dataset check {out}; a card with copolicy-cards dataset {out}",
    }


def selection_record(source: StoredSet, numbers: list[int], asked: dict[str, Any], command: str) -> dict[str, Any]:
    """The record of a conversion with a note on which episodes of it were taken."""
    chosen = set(numbers)
    gone = [row["episode_uuid"] for row in source.rows if row["episode_index"] not in chosen]
    note = {
        "command": command,
        "version": version("lerobot_policy_copolicy"),
        "date": today(),
        "from": {"name": source.root.resolve().name, "content_hash": source.content.hash, "episodes": len(source.rows)},
        "asked": asked,
        "episodes": len(numbers),
    }
    record = without_episodes(source.record, gone)
    return {**record, "selections": [*record.get("selections", []), note]}


def subset_facts(source: StoredSet, numbers: list[int]) -> dict[str, Any]:
    """What a reader of the summary wants to know of some episodes."""
    rows = [source.rows[number] for number in numbers]
    return {
        "episodes": len(rows),
        "frames": sum(row["length"] for row in rows),
        "successes": sum(bool(row["success"]) for row in rows),
        "excluded": sum(bool(row["discarded"]) for row in rows),
        "pairs": len({row["pair_id"] for row in rows if row["pair_id"]}),
        "maps": len({row["map_id"] for row in rows if row["map_id"]}),
    }
