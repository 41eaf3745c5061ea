"""`split`: the episodes of a data set in parts that share no pair, no person or no map."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..exceptions import RunError
from ..features import ACTION, STATE
from ..files.replace_folder import finish_interrupted
from ..files.staging import new_folder, require_new
from .groups import By, base_map, groups
from .parts import Part, deal
from .select import selection_record, subset_facts
from .selection import Row, consents_of
from .subset.stored_set import StoredSet, write_record
from .subset.writing import kept_splits, write_subset

_SHOWN = 12


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
        by: what is never in two parts (`parts.groups`).
        seed: of the order in which equal groups are dealt out.
        drop_excluded: leave out what is discarded or excluded.
        same_consent: a consent id in two pairs is the same person.
        as_splits: one data set at `out` with one part after the other, named in `splits` of `meta/info.json`,
            instead of one folder a part.

    Returns:
        Summary: what is in each part, and the proportions asked for and reached.

    Raises:
        OutputExistsError: there is something at `out`.
        RunError: the parts cannot be had without sharing what must not be shared.
    """
    require_new(out)
    finish_interrupted(root)
    source = StoredSet.read(root)
    numbers = [row["episode_index"] for row in source.rows if not (drop_excluded and row["discarded"])]
    if not numbers:
        raise RunError(f"{root}: expected an episode to split, found {len(source.rows)}, all excluded")
    rows = [source.rows[number] for number in numbers]
    together = groups(rows, [motion(source, number) for number in numbers], by, same_consent)
    dealt = {
        name: [numbers[place] for place in places] for name, places in deal(rows, together, parts, by, seed).items()
    }
    asked = {
        "parts": {part.name: part.proportion or list(part.names) for part in parts},
        "by": by,
        "seed": seed,
        "drop_excluded": drop_excluded,
    }
    hashes: dict[str, str] = {}
    with new_folder(out) as partial:
        if as_splits:
            everything = [number for places in dealt.values() for number in places]
            hashes["all"] = write_subset(source, everything, partial, _spans(dealt))
            write_record(partial, selection_record(source, everything, asked, "copolicy-dataset split"))
        else:
            for name, places in dealt.items():
                folder = partial / name
                hashes[name] = write_subset(source, places, folder, kept_splits({}, places))
                note = {**asked, "part": name}
                write_record(folder, selection_record(source, places, note, "copolicy-dataset split"))
    return {
        "root": str(out),
        "by": by,
        "parts": {part.name: _facts(source, part, dealt[part.name], len(numbers)) for part in parts},
        "left_out": len(source.rows) - len(numbers),
        "in_several_parts": _shared({name: [source.rows[n] for n in places] for name, places in dealt.items()}),
        "content_hash": hashes,
        "not_carried": source.left_behind(),
    }


def motion(source: StoredSet, number: int) -> tuple[str | None, str | None]:
    """What tells the motion of an episode from any other one's."""
    features = source.content.episodes[number].features
    return features.get(STATE), features.get(ACTION)


def _spans(dealt: dict[str, list[int]]) -> dict[str, str]:
    spans, start = {}, 0
    for name, places in dealt.items():
        spans[name] = f"{start}:{start + len(places)}"
        start += len(places)
    return spans


def _facts(source: StoredSet, part: Part, numbers: list[int], total: int) -> dict[str, Any]:
    reached = {"reached": round(len(numbers) / total, 4)}
    asked = {"asked": part.proportion} if part.proportion is not None else {"asked": ",".join(part.names)}
    names = sorted({source.rows[number]["pair_id"] or "" for number in numbers} - {""})
    shown = {"pair_ids": names} if len(names) <= _SHOWN else {}
    return {**asked, **reached, **subset_facts(source, numbers), **shown}


def _shared(parts: dict[str, list[Row]]) -> dict[str, list[str]]:
    """Names by kind (pairs, players, consents, maps) that are in more than one part."""
    kinds = {
        "pairs": lambda row: {row.get("pair_id")},
        "players": lambda row: {row.get("player_0_id"), row.get("player_1_id")},
        "consents": consents_of,
        "maps": lambda row: {base_map(row)},
    }
    shared: dict[str, list[str]] = {}
    for kind, of in kinds.items():
        values = [{value for row in rows for value in of(row) if value} for rows in parts.values()]
        several = sorted(value for value in set().union(*values) if sum(value in part for part in values) > 1)
        if several:
            shared[kind] = several
    return shared
