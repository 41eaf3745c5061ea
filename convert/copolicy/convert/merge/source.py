"""One of the data sets that are merged, and whether it fits to the others."""

from collections.abc import Sequence
from pathlib import Path

from copolicy.dataset.edit.subset.stored_set import StoredSet
from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.files.meta_files import EPISODES_FOLDER, INFO_FILE

try:
    from lerobot.datasets.feature_utils import features_equal_for_merge
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None


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
