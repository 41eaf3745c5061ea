"""A verified data set with all rows of meta/episodes and the record of its conversion, for edits."""

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

_STORAGE_PREFIXES = ("data/", "meta/", "videos/", "stats/")  # columns of meta/episodes about storage
_LOCATIONS = ("episode_index", "length", "dataset_from_index", "dataset_to_index",
              "data/chunk_index", "data/file_index")  # fmt: skip
_WRITTEN = {INFO_FILE, STATS_FILE, TASKS_FILE, RECORD_FILE}
_WRITTEN_FOLDERS = ("data/", "meta/episodes/", "videos/")
_LICENCES = ("LICENSE", "LICENCE", "COPYING", "NOTICE")


@dataclass(frozen=True, repr=False)
class StoredSet:
    """A LeRobot v3 data set written by copolicy, read and verified.

    Attributes:
        info: `meta/info.json`.
        episodes: the rows of meta/episodes with their statistics, in the order of `episode_index`.
        content: digests of the content.
        record: `meta/copolicy.json`, empty if there is none.
    """

    root: Path
    info: dict[str, Any]
    episodes: pa.Table
    content: Content
    record: dict[str, Any]

    @classmethod
    def read(cls, root: Path) -> "StoredSet":
        """Reads a data set and verifies that its files are consistent.

        Raises:
            FileFormatError: not a data set of copolicy, or an inconsistent one.
        """
        folder = require_loadable(root)
        info = folder.info
        tables = episode_tables(root, _LOCATIONS)
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
        """Number, length and episode columns of each episode; None for unknown values."""
        names = [name for name in self.episodes.column_names if not name.startswith(_STORAGE_PREFIXES)]
        return [{**dict.fromkeys(EPISODE_COLUMNS), **row} for row in self.episodes.select(names).to_pylist()]

    @cached_property
    def column_types(self) -> dict[str, str]:
        """Type of the columns of `rows`: `str`, `int`, `float` or `bool`."""
        types: dict[str, str] = {}
        for field in self.episodes.schema:
            matches = {
                "str": pa.types.is_string(field.type) or pa.types.is_large_string(field.type),
                "int": pa.types.is_integer(field.type),
                "float": pa.types.is_floating(field.type),
                "bool": pa.types.is_boolean(field.type),
            }
            column_type = next((name for name, matched in matches.items() if matched), EPISODE_COLUMNS.get(field.name))
            if column_type is not None and not field.name.startswith(_STORAGE_PREFIXES):
                types[field.name] = column_type
        return types

    def uncopied_files(self, licences: bool = False) -> list[str]:
        """Files that describe this data set and are not copied to a new one: card, releases, findings, ...

        Args:
            licences: include licence files, which a merge does not copy.
        """
        minimal = {CARD_FILE} if is_minimal_card(self.root / CARD_FILE) else set()
        copied = _WRITTEN | minimal | (set() if licences else set(self.licences()))
        names = [
            name for name in data_set_files(self.root) if name not in copied and not name.startswith(_WRITTEN_FOLDERS)
        ]
        return names + [f"{folder}/" for folder in ("raw",) if (self.root / folder).is_dir()]

    def licences(self) -> list[str]:
        """Licence files in the folder itself."""
        return sorted(path.name for path in self.root.iterdir() if path.is_file() and path.name.startswith(_LICENCES))


def drop_notes(record: Mapping[str, Any], uuids: Iterable[str]) -> dict[str, Any]:
    """Removes the notes on some episodes from the record of a conversion."""
    removed = set(uuids)
    shortened = {**record}
    if isinstance(record.get("notes"), dict):
        shortened["notes"] = {uuid: notes for uuid, notes in record["notes"].items() if uuid not in removed}
    return shortened


def write_record(folder: Path, record: Mapping[str, Any]) -> None:
    """Writes `meta/copolicy.json` of a new data set."""
    (folder / RECORD_FILE).write_text(record_text(record), encoding="utf-8")


def stored_record(root: Path) -> dict[str, Any]:
    """Reads the record of a conversion, `meta/copolicy.json`; empty if there is none.

    Raises:
        FileFormatError: not a JSON object.
    """
    path = root / RECORD_FILE
    return dict(read_json(path, ConversionRecord, "the record of a conversion")) if path.is_file() else {}


def record_text(record: Mapping[str, Any]) -> str:
    """The record as the JSON text of `meta/copolicy.json`."""
    return json.dumps(record, indent=2) + "\n"
