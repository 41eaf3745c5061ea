"""A data set as the edits need it: verified, with every row of meta/episodes and the record of its conversion."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pyarrow as pa

from ...episode import EPISODE_COLUMNS
from ...exceptions import FileFormatError
from ...files.json_file import read_json
from ...files.meta_files import CARD_FILE, EPISODES_FOLDER, INFO_FILE, RECORD_FILE, STATS_FILE, TASKS_FILE
from ...lerobot_folder.documents import ConversionRecord
from ...lerobot_folder.episode_rows import episode_tables
from ...lerobot_folder.info import stripped_hint
from ...lerobot_folder.loading import require_loadable
from ...publication.minimal_card import is_minimal_card
from ...versions.content import read_content
from ...versions.digests import Content
from ...versions.manifest import data_set_files

_ELSEWHERE = ("data/", "meta/", "videos/", "stats/")  # columns of meta/episodes that say where an episode lies
_PLACES = ("episode_index", "length", "dataset_from_index", "dataset_to_index", "data/chunk_index", "data/file_index")
_WRITTEN = {INFO_FILE, STATS_FILE, TASKS_FILE, RECORD_FILE}
_WRITTEN_FOLDERS = ("data/", "meta/episodes/", "videos/")
_LICENCES = ("LICENSE", "LICENCE", "COPYING", "NOTICE")


@dataclass(frozen=True, repr=False)
class StoredSet:
    """A LeRobot v3 data set of this project that was read completely.

    Attributes:
        info: `meta/info.json`.
        episodes: the rows of meta/episodes, statistics among them, in the order of `episode_index`.
        content: what it holds, by digests.
        record: `meta/copolicy.json`, empty where there is none.
    """

    root: Path
    info: dict[str, Any]
    episodes: pa.Table
    content: Content
    record: dict[str, Any]

    @classmethod
    def read(cls, root: Path) -> "StoredSet":
        """Reads a data set, which also verifies that its files agree with each other.

        Raises:
            FileFormatError: no data set of this project, or one that contradicts itself.
        """
        folder = require_loadable(root)
        info = folder.info
        tables = episode_tables(root, _PLACES)
        try:
            episodes = pa.concat_tables(list(tables.values()), promote_options="permissive").sort_by("episode_index")
        except (pa.ArrowException, KeyError) as error:
            raise FileFormatError(root / EPISODES_FOLDER, "files with the same columns", str(error)) from None
        missing = [name for name in EPISODE_COLUMNS if name not in episodes.column_names]
        if "episode_uuid" in missing or len(missing) > len(EPISODE_COLUMNS) // 2:
            found = f"none named {', '.join(missing[:3])}, ...{stripped_hint(info, root)}"
            raise FileFormatError(root / EPISODES_FOLDER, "the episode columns of copolicy", found)
        folder.rows([name for name in EPISODE_COLUMNS if name not in missing])
        content = read_content(root)
        return cls(root, info, episodes, content, stored_record(root))

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """For each episode its number, length and episode columns; None where nothing is known."""
        names = [name for name in self.episodes.column_names if not name.startswith(_ELSEWHERE)]
        return [{**dict.fromkeys(EPISODE_COLUMNS), **row} for row in self.episodes.select(names).to_pylist()]

    @cached_property
    def column_types(self) -> dict[str, str]:
        """`str`, `int`, `float` or `bool` of each column of `rows` that has one."""
        types: dict[str, str] = {}
        for field in self.episodes.schema:
            kinds = {
                "str": pa.types.is_string(field.type) or pa.types.is_large_string(field.type),
                "int": pa.types.is_integer(field.type),
                "float": pa.types.is_floating(field.type),
                "bool": pa.types.is_boolean(field.type),
            }
            kind = next((name for name, matches in kinds.items() if matches), EPISODE_COLUMNS.get(field.name))
            if kind is not None and not field.name.startswith(_ELSEWHERE):
                types[field.name] = kind
        return types

    def left_behind(self, licences_too: bool = False) -> list[str]:
        """Files about this very data set, which a new one does not take along: card, releases, findings, ...

        Args:
            licences_too: files that state licences stay, too, as in a merge.
        """
        minimal = {CARD_FILE} if is_minimal_card(self.root / CARD_FILE) else set()
        taken = _WRITTEN | minimal | (set() if licences_too else set(self.licences()))
        names = [
            name for name in data_set_files(self.root) if name not in taken and not name.startswith(_WRITTEN_FOLDERS)
        ]
        return names + [f"{folder}/" for folder in ("raw",) if (self.root / folder).is_dir()]

    def licences(self) -> list[str]:
        """Files at the top that state licences."""
        return sorted(path.name for path in self.root.iterdir() if path.is_file() and path.name.startswith(_LICENCES))


def without_episodes(record: Mapping[str, Any], uuids: Iterable[str]) -> dict[str, Any]:
    """The record of a conversion without the notes on some episodes."""
    gone = set(uuids)
    shortened = {**record}
    if isinstance(record.get("notes"), dict):
        shortened["notes"] = {uuid: notes for uuid, notes in record["notes"].items() if uuid not in gone}
    return shortened


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Writes `meta/copolicy.json` of a folder in the making."""
    (folder / RECORD_FILE).write_text(record_text(record), encoding="utf-8")


def stored_record(root: Path) -> dict[str, Any]:
    """The record of a conversion, `meta/copolicy.json`; empty where there is none.

    Raises:
        FileFormatError: no JSON object.
    """
    path = root / RECORD_FILE
    return dict(read_json(path, ConversionRecord, "the record of a conversion")) if path.is_file() else {}


def record_text(record: Mapping[str, Any]) -> str:
    """The text of `meta/copolicy.json`."""
    return json.dumps(record, indent=2) + "\n"
