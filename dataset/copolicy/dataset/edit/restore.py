"""`amend --restore-from`: restores episode columns from recordings or an earlier version of a data set.

LeRobot's delete and split write meta/episodes without them. Episodes are matched by their motion: states and actions
of every frame, bit for bit as a data set stores them.
"""

import hashlib
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from ..checks.episode_data import EpisodeData
from ..checks.leakage import motion_digests
from ..checks.read_lerobot import read_lerobot
from ..clock import Downsampling, frame_actions, frame_states
from ..command_line.commands import progress
from ..episode import EPISODE_COLUMNS, Episode
from ..exceptions import CopolicyError, FileFormatError, RunError
from ..features import ACTION
from ..files.listing import visible_files
from ..files.meta_files import RECORD_FILE
from ..files.replace_folder import finish_interrupted
from ..lerobot_folder.episode_rows import episode_tables, with_column, write_tables
from ..lerobot_folder.info import read_info
from ..recording.reader import read_episode
from .amend import today
from .subset.stored_set import record_text, stored_record

_MAX_SHOWN = 5


@dataclass
class Originals:
    """Episodes with complete columns.

    Attributes:
        kind: what they were read from, `data set` or `recordings`.
        rows: episode columns by digest of the motion; several rows if episodes have the same motion.
        unread: errors of recordings that cannot be read.
        record: `meta/copolicy.json` of a data set.
    """

    kind: str
    rows: dict[str, list[dict[str, Any]]] = field(default_factory=lambda: defaultdict(list))
    unread: list[str] = field(default_factory=list)
    record: dict[str, Any] = field(default_factory=dict)


def restore(root: Path, originals: Path) -> dict[str, Any]:
    """Restores the episode columns of every episode at `root` without an `episode_uuid`.

    Args:
        originals: a data set with the columns, or a folder of recordings.

    Returns:
        Summary.

    Raises:
        FileFormatError: `root` or `originals` has another format.
        RunError: there is nothing to restore, or an episode has no or several originals; nothing was changed.
    """
    finish_interrupted(root)
    tables = episode_tables(root, ("episode_index", "length"))
    stripped = _episodes_without_columns(tables.values())
    if not stripped:
        raise RunError(f"{root}: expected an episode without the episode columns, found an episode_uuid in each")
    motions = _motion_digests(read_lerobot(root), root)
    candidates = _read_data_set(originals, root) if (originals / "meta").is_dir() else _read_recordings(originals, root)
    restored = _match(root, originals, candidates, {number: motions[number] for number in stripped})
    names = {name: None for row in restored.values() for name in row}
    for path, table in tables.items():
        numbers = table.column("episode_index").to_pylist()
        for name in names:
            exists = name in table.column_names
            old_values = table.column(name).to_pylist() if exists else [None] * len(numbers)
            pairs = zip(numbers, old_values, strict=True)
            values = [restored[number].get(name) if number in restored else value for number, value in pairs]
            table = with_column(table, name, values, EPISODE_COLUMNS[name])
        tables[path] = table
    record = stored_record(root) or _restored_record(candidates, restored)
    note = {"date": today(), "episodes": len(restored), "from": candidates.kind}
    text = record_text({**record, "restored": [*record.get("restored", []), note]})
    write_tables(tables, {root / RECORD_FILE: text})
    unlicensed = not all(row.get("license") for row in restored.values())
    licence = f"copolicy-dataset amend {root} --set license=ID, which no original states, then " if unlicensed else ""
    return {
        "root": str(root),
        "restored": len(restored),
        "from": f"{candidates.kind} {originals}",
        **({"not_measured": "replay_drift_px, which conversion measures"} if candidates.kind == "recordings" else {}),
        **({"unread": candidates.unread} if candidates.unread else {}),
        "next": f"{licence}copolicy-dataset check {root}",
    }


def _episodes_without_columns(tables: Any) -> list[int]:
    """Numbers of the episodes without an `episode_uuid`."""
    numbers = []
    for table in tables:
        present = "episode_uuid" in table.column_names
        uuids = table.column("episode_uuid").to_pylist() if present else [None] * table.num_rows
        rows = zip(table.column("episode_index").to_pylist(), uuids, strict=True)
        numbers += [number for number, uuid in rows if not uuid]
    return numbers


def _motion_digests(table: EpisodeData, root: Path) -> dict[int, str]:
    """Digest of the motion of each episode by episode number."""
    if len(table.framed) != len(table.labels):
        missing = next(iter(set(range(len(table.labels))) - set(table.framed.tolist())))
        raise FileFormatError(root, "every frame of each episode", f"others in episode {table.labels[missing]}")
    try:
        digests = motion_digests(table)
    except KeyError as error:
        raise FileFormatError(root, "states and actions in every frame", f"no usable column {error}") from None
    return {int(table.labels[index]): digest for index, digest in zip(table.framed, digests, strict=True)}


def _read_data_set(path: Path, root: Path) -> Originals:
    info, target_info = read_info(path), read_info(root)
    if info.get("fps") != target_info.get("fps"):
        raise FileFormatError(path, f"a data set at {target_info.get('fps')} Hz, as {root}", f"{info.get('fps')} Hz")
    originals = Originals("data set", record=stored_record(path))
    motions = _motion_digests(read_lerobot(path), path)
    for table in episode_tables(path, ("episode_index", "episode_uuid")).values():
        names = [name for name in table.column_names if name in EPISODE_COLUMNS]
        for row in table.select(["episode_index", *names]).to_pylist():
            digest = motions[row.pop("episode_index")]
            if row["episode_uuid"]:
                originals.rows[digest].append(row)
    return originals


def _read_recordings(path: Path, root: Path) -> Originals:
    files = visible_files(path, "*.mcap") if path.is_dir() else [path]
    if not files or not files[0].is_file():
        raise FileFormatError(path, "a data set or a folder of recordings (*.mcap)", "neither")
    info = read_info(root)
    try:
        fps, downsampling = int(info["fps"]), info["features"][ACTION]["hold"]
    except (KeyError, TypeError, ValueError):
        raise FileFormatError(root, "fps and hold of the feature action in meta/info.json", "none") from None
    if downsampling not in get_args(Downsampling):
        raise FileFormatError(
            root, f"a hold of {' or '.join(get_args(Downsampling))} in meta/info.json", str(downsampling)
        )
    originals = Originals("recordings")
    for file in progress(files, len(files), "reading"):
        try:
            episode = read_episode(file)
        except CopolicyError as error:
            originals.unread.append(str(error))
            continue
        originals.rows[_recording_digest(episode, fps, downsampling)].append(asdict(episode.meta))
    return originals


def _recording_digest(episode: Episode, fps: int, downsampling: Downsampling) -> str:
    """Digest of a recording's frames as a data set would store them (`checks.leakage.motion_digests`)."""
    columns = frame_states(episode.states, fps), frame_actions(episode.actions, fps, downsampling)
    rows = np.hstack([column.astype(np.float32) for column in columns])
    return hashlib.sha256(np.ascontiguousarray(rows).tobytes()).hexdigest()


def _match(root: Path, originals: Path, candidates: Originals, motions: Mapping[int, str]) -> dict[int, dict[str, Any]]:
    """Returns the columns of the single original of each episode."""
    restored: dict[int, dict[str, Any]] = {}
    wrong: dict[str, list[int]] = {"none": [], "several": []}
    for number, digest in motions.items():
        rows = {row["episode_uuid"]: row for row in candidates.rows.get(digest, [])}
        if len(rows) == 1:
            restored[number] = next(iter(rows.values()))
        else:
            wrong["several" if rows else "none"].append(number)
    if any(wrong.values()):
        found = "; ".join(f"{problem} for episode {_join(numbers)}" for problem, numbers in wrong.items() if numbers)
        unread = f" ({len(candidates.unread)} recordings cannot be read)" if candidates.unread else ""
        raise RunError(
            f"{originals}: expected one episode with the motion of each of {root}, found {found}{unread}; nothing was "
            "changed"
        )
    by_uuid: dict[str, list[int]] = defaultdict(list)
    for number, row in restored.items():
        by_uuid[row["episode_uuid"]].append(number)
    repeated = [numbers for numbers in by_uuid.values() if len(numbers) > 1]
    if repeated:
        raise RunError(f"{root}: expected each episode once, found the same motion in episodes {_join(repeated[0])}")
    return restored


def _join(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:_MAX_SHOWN])) + (", ..." if len(numbers) > _MAX_SHOWN else "")


def _restored_record(originals: Originals, restored: Mapping[int, Mapping[str, Any]]) -> dict[str, Any]:
    """The conversion record of the originals, with the notes on the restored episodes only."""
    record = dict(originals.record)
    if isinstance(record.get("notes"), dict):
        uuids = {row["episode_uuid"] for row in restored.values()}
        record["notes"] = {uuid: notes for uuid, notes in record["notes"].items() if uuid in uuids}
    return record
