"""The data sets that are merged: whether they fit to each other, and whose pseudonyms are whose.

Every lab begins with P01. Merged as they are, two pairs would count as one: statistics by pair would mix them, a test
set of new people would hold old ones, and a withdrawn consent would take the wrong episodes along. So a name in two
data sets is refused until somebody says which it is. Simulated pairs are this project's own and are the same
everywhere; they are neither compared nor renamed.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
from lerobot.datasets.feature_utils import features_equal_for_merge

from copolicy.dataset.edit.subset.stored_set import StoredSet
from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.meta_files import EPISODES_FOLDER, INFO_FILE

from ..lerobot.shifted_tables import replaced

LOCAL_NAMES = ("session_id", "pair_id", "player_0_id", "player_1_id", "consent_id")
"""The episode columns whose names a lab gives for itself."""
_KINDS = {"pair_id": "pair", "player_0_id": "player", "player_1_id": "player", "consent_id": "consent"}


def read_source(root: Path) -> StoredSet:
    """A data set to merge.

    Raises:
        FileFormatError: no data set of this project, or one that contradicts itself.
    """
    source = StoredSet.read(root)
    there = {*source.episodes.column_names, *LATER_COLUMNS}
    missing = [name for name in EPISODE_COLUMNS if name not in there]
    if missing:
        raise FileFormatError(root / EPISODES_FOLDER, "the episode columns of copolicy", f"no {missing[0]}")
    return source


def require_alike(sources: Sequence[StoredSet]) -> None:
    """Checks that data sets have one format, rate and feature table, and no episode in common.

    Raises:
        FileFormatError: two differ, or an episode is in both.
    """
    first, *others = sources
    for other in others:
        path = other.root / INFO_FILE
        for name in ("codebase_version", "fps", "robot_type"):
            expected, found = first.info.get(name), other.info.get(name)
            if expected != found:
                raise FileFormatError(path, f"{name} {expected!r}, as in {first.root}", repr(found))
        ours, theirs = first.info["features"], other.info["features"]
        for name in sorted({*ours, *theirs}):
            if name not in theirs:
                raise FileFormatError(path, f"the feature {name}, as in {first.root}", "none")
            if name not in ours:
                raise FileFormatError(path, f"no feature {name}, as in {first.root}", "one")
            if not features_equal_for_merge({name: ours[name]}, {name: theirs[name]}):
                raise FileFormatError(path, f"the feature {name} of {first.root}", _difference(ours, theirs, name))
    seen: dict[str, Path] = {}
    for source in sources:
        for episode in source.content.episodes:
            if episode.episode_uuid in seen:
                before = seen[episode.episode_uuid]
                found = f"episode_uuid {episode.episode_uuid} in both"
                raise FileFormatError(source.root, f"no episode of {before}", found)
        seen |= {episode.episode_uuid: source.root for episode in source.content.episodes}


def _difference(ours: dict, theirs: dict, name: str) -> str:
    keys = sorted(key for key in {*ours[name], *theirs[name]} if ours[name].get(key) != theirs[name].get(key))
    return f"{keys[0]} {theirs[name].get(keys[0])!r} instead of {ours[name].get(keys[0])!r}"


def require_prefixes(prefixes: Sequence[str], count: int) -> None:
    """Checks the names of the labs.

    Raises:
        InvalidValueError: not one for each data set, one twice, or one that is no plain word.
    """
    if len(prefixes) != count or len(set(prefixes)) != count:
        raise InvalidValueError("--prefix-people", f"{count} different names, one for each data set", list(prefixes))
    for prefix in prefixes:
        if not re.fullmatch(r"[A-Za-z0-9_]+", prefix):
            raise InvalidValueError("--prefix-people", "names of letters, digits and underscores", prefix)


def require_strangers(sources: Sequence[StoredSet]) -> None:
    """Checks that no pair, player or consent record has the same name in two data sets.

    Raises:
        InvalidValueError: one has.
    """
    seen: dict[tuple[str, str], StoredSet] = {}
    for source in sources:
        names = {(kind, name): source for column, kind in _KINDS.items() for name in _given(source, column)}
        for kind, name in sorted(names):
            if (kind, name) in seen:
                raise InvalidValueError(
                    f"{kind} {name!r}",
                    "a name in one of the data sets only, or --prefix-people LAB LAB (other people) or "
                    "--same-people (the same)",
                    f"it in {seen[kind, name].root} and {source.root}",
                )
        seen |= names


def renamed(episodes: pa.Table, prefix: str) -> pa.Table:
    """Rows of meta/episodes with `prefix-` before every name that the lab gave for itself."""
    simulated = episodes.column("source").to_pylist()
    for column in LOCAL_NAMES:
        names = [
            f"{prefix}-{name}" if name and source != "simulated" else name
            for name, source in zip(episodes.column(column).to_pylist(), simulated, strict=True)
        ]
        episodes = replaced(episodes, column, names)
    return episodes


def _given(source: StoredSet, column: str) -> set[str]:
    rows = source.episodes.select([column, "source"]).to_pylist()
    return {row[column] for row in rows if row[column] and row["source"] != "simulated"}
