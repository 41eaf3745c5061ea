"""Checks that data sets can be merged, and prefixes their pseudonyms.

Every lab numbers its people from P01. Merged unchanged, two pairs would count as one: statistics by pair would mix
them, a test set of new people would hold known ones, and a withdrawn consent would remove the wrong episodes. So a
name that occurs in two data sets is an error unless the caller states whether it is the same person. Names of
simulated pairs mean the same in every data set; they are neither compared nor renamed.
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

from ..lerobot.shifted_tables import replace_column

LOCAL_NAMES = ("session_id", "pair_id", "player_0_id", "player_1_id", "consent_id")
"""The episode columns with names that are unique within one lab only."""
_NAME_KINDS = {"pair_id": "pair", "player_0_id": "player", "player_1_id": "player", "consent_id": "consent"}


def read_source(root: Path) -> StoredSet:
    """Reads a data set to merge.

    Raises:
        FileFormatError: no data set of this project, or one that contradicts itself.
    """
    source = StoredSet.read(root)
    columns = {*source.episodes.column_names, *LATER_COLUMNS}
    missing = [name for name in EPISODE_COLUMNS if name not in columns]
    if missing:
        raise FileFormatError(root / EPISODES_FOLDER, "the episode columns of copolicy", f"no {missing[0]}")
    return source


def require_same_format(sources: Sequence[StoredSet]) -> None:
    """Checks that data sets have the same format, rate, task and features, and no episode in common.

    Raises:
        FileFormatError: two differ, or share an episode.
    """
    first = sources[0]
    for source in sources[1:]:
        path = source.root / INFO_FILE
        for name in ("codebase_version", "fps", "robot_type"):
            expected, found = first.info.get(name), source.info.get(name)
            if expected != found:
                raise FileFormatError(path, f"{name} {expected!r}, as in {first.root}", repr(found))
        reference, features = first.info["features"], source.info["features"]
        for name in sorted({*reference, *features}):
            if name not in features:
                raise FileFormatError(path, f"the feature {name}, as in {first.root}", "none")
            if name not in reference:
                raise FileFormatError(path, f"no feature {name}, as in {first.root}", "one")
            if not features_equal_for_merge({name: reference[name]}, {name: features[name]}):
                raise FileFormatError(
                    path, f"the feature {name} of {first.root}", _difference(reference, features, name)
                )
    roots: dict[str, Path] = {}
    for source in sources:
        for episode in source.content.episodes:
            if episode.episode_uuid in roots:
                found = f"episode_uuid {episode.episode_uuid} in both"
                raise FileFormatError(source.root, f"no episode of {roots[episode.episode_uuid]}", found)
        roots |= {episode.episode_uuid: source.root for episode in source.content.episodes}


def _difference(reference: dict, features: dict, name: str) -> str:
    expected, found = reference[name], features[name]
    key = min(key for key in {*expected, *found} if expected.get(key) != found.get(key))
    return f"{key} {found.get(key)!r} instead of {expected.get(key)!r}"


def require_prefixes(prefixes: Sequence[str], count: int) -> None:
    """Checks the prefixes.

    Raises:
        InvalidValueError: not one for each data set, one twice, or one with other characters than `[A-Za-z0-9_]`.
    """
    if len(prefixes) != count or len(set(prefixes)) != count:
        raise InvalidValueError("--prefix-people", f"{count} different names, one for each data set", list(prefixes))
    for prefix in prefixes:
        if not re.fullmatch(r"[A-Za-z0-9_]+", prefix):
            raise InvalidValueError("--prefix-people", "names of letters, digits and underscores", prefix)


def require_distinct_names(sources: Sequence[StoredSet]) -> None:
    """Checks that no name of a pair, player or consent record occurs in two data sets.

    Raises:
        InvalidValueError: one does.
    """
    sources_by_name: dict[tuple[str, str], StoredSet] = {}
    for source in sources:
        names = {(kind, name): source for column, kind in _NAME_KINDS.items() for name in _local_names(source, column)}
        for kind, name in sorted(names):
            if (kind, name) in sources_by_name:
                raise InvalidValueError(
                    f"{kind} {name!r}",
                    "a name in one of the data sets only, or --prefix-people LAB LAB (different people) or "
                    "--same-people (the same)",
                    f"it in {sources_by_name[kind, name].root} and {source.root}",
                )
        sources_by_name |= names


def with_prefix(episodes: pa.Table, prefix: str) -> pa.Table:
    """Puts `prefix-` before the names in the `LOCAL_NAMES` columns of meta/episodes rows."""
    sources = episodes.column("source").to_pylist()
    for column in LOCAL_NAMES:
        names = [
            f"{prefix}-{name}" if name and source != "simulated" else name
            for name, source in zip(episodes.column(column).to_pylist(), sources, strict=True)
        ]
        episodes = replace_column(episodes, column, names)
    return episodes


def _local_names(source: StoredSet, column: str) -> set[str]:
    rows = source.episodes.select([column, "source"]).to_pylist()
    return {row[column] for row in rows if row[column] and row["source"] != "simulated"}
