"""Merges data sets with LeRobot's aggregation, and restores the column values and types that it changes.

LeRobot reads tables with pandas, which turns NaN ("not measured") into null and fixed-size lists into lists of any
length. Indices, file numbers and times are taken from its output, every other column from the sources, with its type.
The content of every episode is then compared with its source.
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
from ..lerobot.shifted_tables import replace_column
from ..lerobot.stored_rewards import reward_differences
from .checks import LOCAL_NAMES, read_source, require_distinct_names, require_prefixes, require_same_format, with_prefix

_RENUMBERED = ("data/", "videos/", "meta/episodes/", "stats/index/", "stats/episode_index/", "stats/task_index/")
_NUMBERS = {"episode_index", "dataset_from_index", "dataset_to_index"}


def merge_datasets(
    roots: Sequence[Path | str],
    root: Path | str,
    repo_id: str,
    prefixes: Sequence[str] | None = None,
    same_people: bool = False,
) -> dict[str, Any]:
    """Writes the episodes of several data sets, one after the other, as one data set at `root`.

    Exclusions are episode columns and are kept. Statistics, releases, cards and recordings of the sources are not
    copied; `meta/copolicy.json` of the result states the content hash of each source.

    Args:
        prefixes: one for each data set, put before the names in its `LOCAL_NAMES` columns.
        same_people: a name that occurs in several data sets is the same person.

    Returns:
        Summary.

    Raises:
        OutputExistsError: `root` exists.
        FileFormatError: not all are data sets of this project with the same rate and features, or two share an episode.
        InvalidValueError: a name occurs in two data sets, and neither `prefixes` nor `same_people` is given.
    """
    roots, root = [Path(path) for path in roots], Path(root)
    require_new(root)
    if prefixes is not None:
        require_prefixes(prefixes, len(roots))
    sources = [read_source(path) for path in roots]
    require_same_format(sources)
    if prefixes is None and not same_people:
        require_distinct_names(sources)
    tables = [
        source.episodes if prefixes is None else with_prefix(source.episodes, prefixes[index])
        for index, source in enumerate(sources)
    ]
    expected = _concatenated(sources, tables)
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
        "excluded": sum(bool(discarded) for discarded in expected.column("discarded").to_pylist()),
        **mixtures.summary(),
        "content_hash": content.hash,
        "left_behind": left_behind,
    }


def _mixtures(episodes: pa.Table, sources: Sequence[StoredSet]) -> Mixtures:
    columns = [name for name in EPISODE_COLUMNS if name in episodes.column_names]
    roots, records = [source.root for source in sources], [source.record for source in sources]
    data_sets, rewards = ", ".join(map(str, roots)), reward_differences(roots)
    rows = episodes.select(columns).to_pylist()
    return Mixtures.from_rows(rows, task_of(sources[0].info), data_sets, records, rewards)


def _concatenated(sources: Sequence[StoredSet], tables: Sequence[pa.Table]) -> pa.Table:
    """Concatenates the rows of meta/episodes; where a data set lacks a column, null or its unknown value."""
    types = {field.name: field.type for field in tables[0].schema}
    for source, table in zip(sources, tables, strict=True):
        for field in table.schema:
            column_type = types.setdefault(field.name, field.type)
            if pa.types.is_null(column_type):
                types[field.name] = field.type
            elif field.type != column_type and not pa.types.is_null(field.type):
                folder = source.root / EPISODES_FOLDER
                raise FileFormatError(folder, f"column {field.name} of type {column_type}", str(field.type))
    return pa.concat_tables(
        [
            pa.table(
                {
                    name: _without_nan(name, table.column(name).cast(arrow_type))
                    if name in table.column_names
                    else pa.array([UNKNOWN_VALUES[name] if name in LATER_COLUMNS else None] * len(table), arrow_type)
                    for name, arrow_type in types.items()
                }
            )
            for table in tables
        ]
    )


def _without_nan(name: str, column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Turns NaN, which data sets of earlier versions store for unknown numbers, into null."""
    if EPISODE_COLUMNS.get(name) != "float":
        return column
    return pa.chunked_array([pa.array(column.to_pylist(), column.type, from_pandas=True)])


def _restore_episodes(root: Path, expected: pa.Table) -> None:
    start = 0
    for path in chunk_files(root / EPISODES_FOLDER).values():
        merged = read_parquet(path)
        rows = expected.slice(start, merged.num_rows)
        for name in rows.column_names:
            if name in _NUMBERS or name.startswith(_RENUMBERED):
                rows = replace_column(rows, name, merged.column(name).cast(rows.schema.field(name).type))
        pq.write_table(rows, path, compression="snappy", use_dictionary=True)
        start += merged.num_rows


def _restore_frames(root: Path) -> None:
    """Rewrites the data files with the types of the features, one row group per episode, one file at a time."""
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
    originals = [episode for dataset in sources for episode in dataset.content.episodes]
    if len(content.episodes) != len(originals):
        raise RunError(f"merge: expected {len(originals)} episodes, found {len(content.episodes)}; nothing was written")
    for source, merged in zip(originals, content.episodes, strict=True):
        expected = {name: digest for name, digest in source.columns.items() if name not in renamed_columns}
        parts = {
            "episode_uuid": source.episode_uuid == merged.episode_uuid,
            "frames": source.frames == merged.frames,
            **{name: merged.features.get(name) == digest for name, digest in source.features.items()},
            **{name: merged.columns.get(name) == digest for name, digest in expected.items()},
        }
        if not all(parts.values()):
            changed = next(name for name, unchanged in parts.items() if not unchanged)
            raise RunError(
                f"episode {source.episode_uuid}: expected {changed} unchanged by the merge, found otherwise; "
                "nothing was written"
            )


def _record(sources: Sequence[StoredSet], prefixes: Sequence[str] | None) -> dict[str, Any]:
    notes: dict[str, Any] = {}
    parts = []
    for index, source in enumerate(sources):
        record = dict(source.record)
        notes |= record.pop("notes", {})
        parts.append(
            {
                "name": source.root.resolve().name,
                "content_hash": source.content.hash,
                "episodes": len(source.content.episodes),
                "prefix": prefixes[index] if prefixes else "",
                "record": record,
            }
        )
    info = sources[0].info
    return {
        "converter": "copolicy-convert merge",
        "version": version("lerobot_policy_copolicy"),
        "merged": parts,
        "task": task_of(info).spec.to_dict(),
        "fps": info["fps"],
        "hold": info["features"]["action"].get("hold", ""),
        "notes": notes,
    }
