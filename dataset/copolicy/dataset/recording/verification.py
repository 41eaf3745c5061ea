"""Verification of a recording: parts without check sum, schema version, digest of the metadata, counts."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from ..episode import SET_COLUMNS
from ..exceptions import FileFormatError, ForeignRecordingError
from . import episode_records
from .mcap_records import RecordWalk

RECOVERY = "recovery"
"""The metadata record about the source of a recovered file."""

UNVERIFIED = "unverified"
"""The entry of that record about the parts of the source without check sum."""

_USED = "could not be verified and {verb} used as {pronoun}"
_THEY = _USED.format(verb="are", pronoun="they stand")
_IT = _USED.format(verb="is", pronoun="it stands")
_TOPICS_SHOWN = 5
_ENTRIES: dict[str, tuple[str, ...]] = {
    **{name: tuple(set(columns) - set(SET_COLUMNS)) for name, columns in episode_records.COLUMNS_AT_START.items()},
    "dataset_info": ("fps", episode_records.START_DIGEST),
    episode_records.RESULT: episode_records.COLUMNS_AT_END,
}
"""Entries that distinguish a metadata record of ours from another project's record of the same name."""


@dataclass
class CheckSums:
    """Which parts of a file have a check sum.

    Attributes:
        data: whether a check sum verified the whole data section, which covers all other parts.
        chunks: number of chunks.
        chunks_without: number of chunks without check sum.
        lone_messages: number of state, action and event messages outside of chunks, which have no check sum.
        map: whether the attachment with the scenario has a check sum.
        start: whether the metadata at the start of the recording have a digest.
    """

    data: bool = False
    chunks: int = 0
    chunks_without: int = 0
    lone_messages: int = 0
    map: bool = False
    start: bool = False

    def content_notes(self) -> tuple[str, ...]:
        """Notes about messages and scenario without check sum."""
        if self.data:
            return ()
        notes = []
        if self.chunks_without:
            notes.append(f"{self.chunks_without} of {self.chunks} chunks carry no check sum: their content {_IT}")
        if self.lone_messages:
            notes.append(f"{self.lone_messages} messages outside of chunks carry no check sum: they {_THEY}")
        if not self.map:
            notes.append(f"the map carries no check sum: it {_IT}")
        return tuple(notes)

    def notes(self) -> tuple[str, ...]:
        """Notes about all parts of the file without check sum."""
        if self.data:
            return ()
        metadata = f"the result of the episode {_IT}" if self.start else f"the metadata {_THEY}"
        return (*self.content_notes(), f"the data section carries no check sum: {metadata}")


def sole_records(
    path: Path, records: Mapping[str, Sequence[dict[str, str]]], settings: Iterable[str]
) -> dict[str, dict[str, str]]:
    """The metadata records of a file by name; of several records of one name, the one with our entries.

    Another project may write a record of the same name into the file.

    Args:
        settings: names of the task's world settings, the entries of the record `physics`.

    Raises:
        FileFormatError: several records of one name have our entries.
    """
    entries_of_record = {**_ENTRIES, "physics": tuple(settings)}
    chosen: dict[str, dict[str, str]] = {}
    for name, candidates in records.items():
        if len(candidates) > 1 and name in entries_of_record:
            own_candidates = [entries for entries in candidates if set(entries_of_record[name]) <= set(entries)]
            if len(own_candidates) != 1:
                raise FileFormatError(path, "one episode", f"a second metadata record {name!r}")
            candidates = own_candidates
        chosen[name] = candidates[-1]
    return chosen


def require_version(path: Path, records: Mapping[str, Mapping[str, str]]) -> None:
    """Checks the schema version in the metadata, if they state one.

    Raises:
        ForeignRecordingError: the schema version is unknown.
    """
    supported = episode_records.SCHEMA_VERSION
    version = records.get("dataset_info", {}).get("schema_version", supported)
    if version != supported:
        expected = f"a recording of schema version {supported}, the latest supported"
        raise ForeignRecordingError(path, expected, f"schema version {version!r} (update copolicy)")


def require_start_digest(path: Path, records: Mapping[str, Mapping[str, str]]) -> bool:
    """Verifies the digest of the metadata at the start of a recording; returns whether there is one.

    Raises:
        FileFormatError: the digest does not match.
    """
    digest = records["dataset_info"].get(episode_records.START_DIGEST)
    if digest is not None and digest != episode_records.start_digest(records):
        raise FileFormatError(path, "the metadata that was written at the start", "another")
    return digest is not None


def require_statistics(path: Path, walk: RecordWalk, messages: int) -> None:
    """Compares the numbers of records with the statistics in the summary, if present.

    Args:
        walk: the finished walk over the file.
        messages: number of messages, in chunks and outside of them.

    Raises:
        FileFormatError: the numbers differ.
    """
    statistics = walk.statistics
    if statistics is None:
        return
    for record_type, expected, count in (
        ("messages", statistics.message_count, messages),
        ("chunks", statistics.chunk_count, walk.counts[Opcode.CHUNK]),
        ("attachments", statistics.attachment_count, walk.counts[Opcode.ATTACHMENT]),
        ("metadata records", statistics.metadata_count, walk.counts[Opcode.METADATA]),
    ):
        if expected != count:
            raise FileFormatError(path, f"{expected} {record_type}, as its summary counts", str(count))


def channels_text(topics: Iterable[str]) -> str:
    """Description of a file with other channels than those of the task."""
    names = sorted(set(topics))
    if not names:
        return "an MCAP file without channels"
    suffix = f" and {len(names) - _TOPICS_SHOWN} more" if len(names) > _TOPICS_SHOWN else ""
    return f"no recording of this task (channels: {', '.join(names[:_TOPICS_SHOWN])}{suffix})"
