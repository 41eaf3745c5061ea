"""Merges data sets with LeRobot's aggregation, and puts right what that does to the tables.

LeRobot reads tables with pandas, which writes NaN ("not measured") as null and vectors of a fixed length as lists of
any. Numbers, files and times are taken from what it wrote; every other column from the data sets as they were, with
its type. The content of every episode is then compared with what it was.
"""

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from lerobot.datasets.feature_utils import get_hf_features_from_features

from copolicy.dataset.edit.subset.stored_set import StoredSet, write_record
from copolicy.dataset.episode import EPISODE_COLUMNS, LATER_COLUMNS, UNKNOWN_VALUES
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.files.meta_files import CARD_FILE, EPISODES_FOLDER
from copolicy.dataset.files.staging import new_folder, require_new
from copolicy.dataset.lerobot_folder.info import read_info, task_name, task_of
from copolicy.dataset.lerobot_folder.references import chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet
from copolicy.dataset.publication.minimal_card import write_minimal_card
from copolicy.dataset.versions.content import read_content
from copolicy.dataset.versions.digests import Content

from ..lerobot.joined_sets import join_data_sets
from ..lerobot.mixtures import Mixtures
from ..lerobot.shifted_tables import replaced
from ..lerobot.stored_rewards import foreign_rewards
from .source import LOCAL_NAMES, read_source, renamed, require_alike, require_prefixes, require_strangers

_MOVED = ("data/", "videos/", "meta/episodes/", "stats/index/", "stats/episode_index/", "stats/task_index/")
_NUMBERS = {"episode_index", "dataset_from_index", "dataset_to_index"}


def merge_datasets(
    roots: Sequence[Path], root: Path, repo_id: str, prefixes: Sequence[str] | None = None, same_people: bool = False
) -> dict[str, Any]:
    """Writes the episodes of several data sets, one after the other, as one at `root`.

    Exclusions are episode columns and stay. Statistics, releases, cards and recordings are about one data set and
    stay behind; the result's record `meta/copolicy.json` names the content hash of each.

    Args:
        prefixes: one for each data set, put before the names that its lab gave (see `people`).
        same_people: a name in several data sets is the same person.

    Returns:
        Summary.

    Raises:
        OutputExistsError: there is something at `root`.
        FileFormatError: not all are data sets of this project with the same rate and features, or two share an episode.
        InvalidValueError: two use the same name for a person, and nobody says whether it is the same one.
    """
    require_new(root)
    if prefixes is not None:
        require_prefixes(prefixes, len(roots))
    sources = [read_source(path) for path in roots]
    require_alike(sources)
    if prefixes is None and not same_people:
        require_strangers(sources)
    tables = [
        source.episodes if prefixes is None else renamed(source.episodes, prefixes[place])
        for place, source in enumerate(sources)
    ]
    expected = _joined(sources, tables)
    mixtures = _mixtures(expected, sources)
    with new_folder(root) as partial:
        join_data_sets(roots, repo_id, partial, partial.with_name(f"{partial.name}.cache"))
        _restore_episodes(partial, expected)
        _restore_frames(partial)
        content = read_content(partial)
        _verify(content, sources, set(LOCAL_NAMES) if prefixes else set())
        record = _record(sources, prefixes)
        write_record(partial, record)
        write_minimal_card(partial / CARD_FILE, set(expected.column("license").to_pylist()), task_name(sources[0].info))
    left_behind = {str(source.root): names for source in sources if (names := source.uncopied_files(licences=True))}
    return {
        "root": str(root),
        "repo_id": repo_id,
        "episodes": len(content.episodes),
        "frames": sum(episode.frames for episode in content.episodes),
        "excluded": sum(bool(mark) for mark in expected.column("discarded").to_pylist()),
        **mixtures.summary(),
        "content_hash": content.hash,
        "left_behind": left_behind,
    }


def _mixtures(episodes: pa.Table, sources: Sequence[StoredSet]) -> Mixtures:
    named = [name for name in EPISODE_COLUMNS if name in episodes.column_names]
    roots, records = [source.root for source in sources], [source.record for source in sources]
    where, rewards = ", ".join(map(str, roots)), foreign_rewards(roots)
    return Mixtures.of(episodes.select(named).to_pylist(), task_of(sources[0].info), where, records, rewards)


def _joined(sources: Sequence[StoredSet], tables: Sequence[pa.Table]) -> pa.Table:
    """All rows of meta/episodes as they were; where a data set lacks a column, null or what a later column is then."""
    types = {field.name: field.type for field in tables[0].schema}
    for source, table in zip(sources, tables, strict=True):
        for field in table.schema:
            known = types.setdefault(field.name, field.type)
            if pa.types.is_null(known):
                types[field.name] = field.type
            elif field.type != known and not pa.types.is_null(field.type):
                where = source.root / EPISODES_FOLDER
                raise FileFormatError(where, f"column {field.name} of type {known}", str(field.type))
    return pa.concat_tables(
        [
            pa.table(
                {
                    name: _without_nan(name, table.column(name).cast(kind))
                    if name in table.column_names
                    else pa.array([UNKNOWN_VALUES[name] if name in LATER_COLUMNS else None] * table.num_rows, kind)
                    for name, kind in types.items()
                }
            )
            for table in tables
        ]
    )


def _without_nan(name: str, column: pa.ChunkedArray) -> pa.ChunkedArray:
    """A number that is not known, as data sets of earlier versions have it, is null."""
    if EPISODE_COLUMNS.get(name) != "float":
        return column
    return pa.chunked_array([pa.array(column.to_pylist(), column.type, from_pandas=True)])


def _restore_episodes(root: Path, expected: pa.Table) -> None:
    start = 0
    for path in chunk_files(root / EPISODES_FOLDER).values():
        merged = read_parquet(path)
        rows = expected.slice(start, merged.num_rows)
        for name in rows.column_names:
            if name in _NUMBERS or name.startswith(_MOVED):
                rows = replaced(rows, name, merged.column(name).cast(rows.schema.field(name).type))
        pq.write_table(rows, path, compression="snappy", use_dictionary=True)
        start += merged.num_rows


def _restore_frames(root: Path) -> None:
    """The data files with the types of the feature table, a row group an episode; one file is in memory at a time."""
    features = read_info(root)["features"]
    features = {name: {**feature, "shape": tuple(feature["shape"])} for name, feature in features.items()}
    schema = get_hf_features_from_features(features).arrow_schema
    for path in chunk_files(root / "data").values():
        table = read_parquet(path).select(schema.names).cast(schema)
        episodes = table.column("episode_index").to_pylist()
        with pq.ParquetWriter(path, schema, compression="snappy", use_dictionary=True) as writer:
            start = 0
            for row in range(1, len(episodes) + 1):
                if row == len(episodes) or episodes[row] != episodes[start]:
                    writer.write_table(table.slice(start, row - start))
                    start = row


def _verify(content: Content, sources: Sequence[StoredSet], renamed_columns: set[str]) -> None:
    before = [episode for source in sources for episode in source.content.episodes]
    if len(content.episodes) != len(before):
        raise RunError(f"merge: expected {len(before)} episodes, found {len(content.episodes)}; nothing was written")
    for was, now in zip(before, content.episodes, strict=True):
        kept = {name: digest for name, digest in was.columns.items() if name not in renamed_columns}
        parts = {
            "episode_uuid": was.episode_uuid == now.episode_uuid,
            "frames": was.frames == now.frames,
            **{name: now.features.get(name) == digest for name, digest in was.features.items()},
            **{name: now.columns.get(name) == digest for name, digest in kept.items()},
        }
        if not all(parts.values()):
            changed = next(name for name, same in parts.items() if not same)
            raise RunError(
                f"episode {was.episode_uuid}: expected {changed} unchanged by the merge, found otherwise; "
                "nothing was written"
            )


def _record(sources: Sequence[StoredSet], prefixes: Sequence[str] | None) -> dict[str, Any]:
    notes: dict[str, Any] = {}
    merged = []
    for place, source in enumerate(sources):
        record = dict(source.record)
        notes |= record.pop("notes", {})
        merged.append(
            {
                "name": source.root.resolve().name,
                "content_hash": source.content.hash,
                "episodes": len(source.content.episodes),
                "prefix": prefixes[place] if prefixes else "",
                "record": record,
            }
        )
    info = sources[0].info
    return {
        "converter": "copolicy-convert merge",
        "version": version("lerobot_policy_copolicy"),
        "merged": merged,
        "task": task_of(info).spec.to_dict(),
        "fps": info["fps"],
        "hold": info["features"]["action"].get("hold", ""),
        "notes": notes,
    }
