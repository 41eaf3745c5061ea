"""One of the data sets that are merged, and whether it fits to the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.documents import RECORD_FILE
from copolicy.dataset.edit.subset.stored_set import stored_record
from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS
from copolicy.dataset.exceptions import FileFormatError, MissingExtraError
from copolicy.dataset.lerobot_folder.info import INFO_FILE, STATS_FILE, TASKS_FILE, read_info
from copolicy.dataset.lerobot_folder.loading import require_loadable
from copolicy.dataset.minimal_card import CARD_FILE, is_minimal_card
from copolicy.dataset.versions.content import Content, read_content
from copolicy.dataset.versions.manifest import data_set_files

from ..shifted_tables import numbered_files, read_table

try:
    import pyarrow as pa
    from lerobot.datasets.feature_utils import features_equal_for_merge
except ImportError as error:
    raise MissingExtraError((error.name or "lerobot").split(".")[0]) from None

_CARRIED = ("data/", "meta/episodes/", "videos/")
_REWRITTEN = {INFO_FILE.as_posix(), STATS_FILE.as_posix(), TASKS_FILE.as_posix(), RECORD_FILE.as_posix()}


@dataclass(frozen=True)
class MergeSource:
    """A data set to merge.

    Attributes:
        info: `meta/info.json`.
        episodes: the rows of meta/episodes, in the order of `episode_index`.
        content: what it holds, by digests.
        record: `meta/copolicy.json`, empty where there is none.
    """

    root: Path
    info: dict[str, Any]
    episodes: "pa.Table"
    content: Content
    record: dict[str, Any]

    @classmethod
    def read(cls, root: Path) -> "MergeSource":
        """Reads a data set completely, which also verifies that its files agree with each other.

        Raises:
            FileFormatError: no data set of this project, or one that contradicts itself.
        """
        require_loadable(root)
        content = read_content(root)
        tables = [read_table(path) for path in numbered_files(root / "meta" / "episodes").values()]
        try:
            episodes = pa.concat_tables(tables, promote_options="permissive").sort_by("episode_index")
        except pa.ArrowException as error:
            raise FileFormatError(root / "meta" / "episodes", "files with the same columns", str(error)) from None
        missing = [name for name in EPISODE_COLUMNS if name not in {*episodes.column_names, *LATER_COLUMNS}]
        if missing:
            raise FileFormatError(root / "meta" / "episodes", "the episode columns of copolicy", f"no {missing[0]}")
        return cls(root, read_info(root), episodes, content, stored_record(root))

    def left_behind(self) -> list[str]:
        """Files that are about this data set alone and are not carried over: its statistics, releases, card, ..."""
        names = [name for name in data_set_files(self.root) if name not in _REWRITTEN and not name.startswith(_CARRIED)]
        names = [name for name in names if name != CARD_FILE or not is_minimal_card(self.root / name)]
        return names + [f"{folder}/" for folder in ("raw",) if (self.root / folder).is_dir()]


def require_alike(sources: Sequence[MergeSource]) -> None:
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
