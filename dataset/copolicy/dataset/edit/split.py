"""`split`: splits a data set into parts that share no pair, no person or no map."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..exceptions import RunError
from ..features import ACTION, STATE
from ..files.replace_folder import finish_interrupted
from ..files.staging import new_folder, require_new
from .groups import By, base_map, group_episodes
from .parts import Part, assign_groups
from .select import selection_record, subset_facts
from .selection import Row, consent_ids
from .subset.stored_set import StoredSet, write_record
from .subset.writing import remaining_splits, write_subset

_MAX_SHOWN = 12


def split(
    root: Path,
    out: Path,
    parts: Sequence[Part],
    by: By = "pairs",
    seed: int = 0,
    drop_excluded: bool = False,
    same_consent: bool = False,
    as_splits: bool = False,
) -> dict[str, Any]:
    """Writes the parts of a data set to `out`, all or none of them.

    Args:
        by: unit that is never in two parts (`groups.group_episodes`).
        seed: seed of the order of groups of equal size.
        drop_excluded: leave out discarded and excluded episodes.
        same_consent: a consent id in two pairs is the same person.
        as_splits: write one data set with consecutive parts, listed in `splits` of `meta/info.json`, instead of one
            folder per part.

    Returns:
        Summary: counts of each part, requested and reached proportions.

    Raises:
        OutputExistsError: `out` exists.
        RunError: the parts cannot be formed without sharing a group.
    """
    require_new(out)
    finish_interrupted(root)
    source = StoredSet.read(root)
    numbers = [row["episode_index"] for row in source.rows if not (drop_excluded and row["discarded"])]
    if not numbers:
        raise RunError(f"{root}: expected an episode to split, found {len(source.rows)}, all excluded")
    rows = [source.rows[number] for number in numbers]
    groups = group_episodes(rows, [motion_digest(source, number) for number in numbers], by, same_consent)
    indices_of_parts = assign_groups(rows, groups, parts, by, seed)
    numbers_of_parts = {name: [numbers[i] for i in indices] for name, indices in indices_of_parts.items()}
    criteria = {
        "parts": {part.name: part.proportion or list(part.names) for part in parts},
        "by": by,
        "seed": seed,
        "drop_excluded": drop_excluded,
    }
    hashes: dict[str, str] = {}
    with new_folder(out) as partial:
        if as_splits:
            all_numbers = [number for part_numbers in numbers_of_parts.values() for number in part_numbers]
            hashes["all"] = write_subset(source, all_numbers, partial, _spans(numbers_of_parts))
            write_record(partial, selection_record(source, all_numbers, criteria, "copolicy-dataset split"))
        else:
            for name, part_numbers in numbers_of_parts.items():
                folder = partial / name
                hashes[name] = write_subset(source, part_numbers, folder, remaining_splits({}, part_numbers))
                note = {**criteria, "part": name}
                write_record(folder, selection_record(source, part_numbers, note, "copolicy-dataset split"))
    return {
        "root": str(out),
        "by": by,
        "parts": {part.name: _facts(source, part, numbers_of_parts[part.name], len(numbers)) for part in parts},
        "left_out": len(source.rows) - len(numbers),
        "in_several_parts": _shared_names([[source.rows[n] for n in part] for part in numbers_of_parts.values()]),
        "content_hash": hashes,
        "not_carried": source.uncopied_files(),
    }


def motion_digest(source: StoredSet, number: int) -> tuple[str | None, str | None]:
    """Digests of the states and actions of an episode."""
    features = source.content.episodes[number].features
    return features.get(STATE), features.get(ACTION)


def _spans(parts: dict[str, list[int]]) -> dict[str, str]:
    spans, start = {}, 0
    for name, numbers in parts.items():
        spans[name] = f"{start}:{start + len(numbers)}"
        start += len(numbers)
    return spans


def _facts(source: StoredSet, part: Part, numbers: list[int], total: int) -> dict[str, Any]:
    reached = {"reached": round(len(numbers) / total, 4)}
    requested = {"asked": part.proportion} if part.proportion is not None else {"asked": ",".join(part.names)}
    names = sorted({source.rows[number]["pair_id"] or "" for number in numbers} - {""})
    shown = {"pair_ids": names} if len(names) <= _MAX_SHOWN else {}
    return {**requested, **reached, **subset_facts(source, numbers), **shown}


def _shared_names(parts: list[list[Row]]) -> dict[str, list[str]]:
    """Pairs, players, consents and maps that are in more than one part."""
    ids_of_row = {
        "pairs": lambda row: {row.get("pair_id")},
        "players": lambda row: {row.get("player_0_id"), row.get("player_1_id")},
        "consents": consent_ids,
        "maps": lambda row: {base_map(row)},
    }
    shared: dict[str, list[str]] = {}
    for category, ids_of in ids_of_row.items():
        ids_of_parts = [{name for row in rows for name in ids_of(row) if name} for rows in parts]
        repeated = sorted(name for name in set().union(*ids_of_parts) if sum(name in part for part in ids_of_parts) > 1)
        if repeated:
            shared[category] = repeated
    return shared
