"""The checks of a recording: its check sums, and version, digest and counts where it has none."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from ..episode import SET_COLUMNS
from ..exceptions import FileFormatError, ForeignRecordingError
from . import episode_records
from .mcap_records import RecordWalk

RECOVERY = "recovery"
"""The metadata record that says what a recovered file was made from."""

UNVERIFIED = "unverified"
"""Its entry that says what of the source carried no check sum."""

_USED = "could not be verified and {verb} used as {pronoun}"
_THEY = _USED.format(verb="are", pronoun="they stand")
_IT = _USED.format(verb="is", pronoun="it stands")
_TOPICS_SHOWN = 5
_ENTRIES: dict[str, tuple[str, ...]] = {
    **{name: tuple(set(columns) - set(SET_COLUMNS)) for name, columns in episode_records.COLUMNS_AT_START.items()},
    "dataset_info": ("fps", episode_records.START_DIGEST),
    episode_records.RESULT: episode_records.COLUMNS_AT_END,
}
"""Entries by which a metadata record is told from another project's of the same name."""


@dataclass
class CheckSums:
    """What of a file carries a check sum.

    Attributes:
        data: the whole data section passed one, so that nothing else matters.
        chunks: their number.
        chunks_without: the chunks that carry none.
        lone_messages: messages of states, actions and events outside of any chunk, which can carry none.
        map: the attachment with the map carries one.
        start: the metadata at the start of the recording carry their digest.
    """

    data: bool = False
    chunks: int = 0
    chunks_without: int = 0
    lone_messages: int = 0
    map: bool = False
    start: bool = False

    def content_notes(self) -> tuple[str, ...]:
        """What of messages and map could not be verified, a sentence each."""
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
        """The same for a whole file, with its metadata."""
        if self.data:
            return ()
        metadata = f"the result of the episode {_IT}" if self.start else f"the metadata {_THEY}"
        return (*self.content_notes(), f"the data section carries no check sum: {metadata}")


def sole_records(
    path: Path, records: Mapping[str, Sequence[dict[str, str]]], settings: Iterable[str]
) -> dict[str, dict[str, str]]:
    """The metadata records of a file by name; of several of a name of ours, the one that has our entries.

    Another project may have a record of the same name beside ours.

    Args:
        settings: names of the settings of the task, the entries of the record `physics`.

    Raises:
        FileFormatError: several of a name are ours.
    """
    known = {**_ENTRIES, "physics": tuple(settings)}
    chosen: dict[str, dict[str, str]] = {}
    for name, candidates in records.items():
        if len(candidates) > 1 and name in known:
            ours = [entries for entries in candidates if set(known[name]) <= set(entries)]
            if len(ours) != 1:
                raise FileFormatError(path, "one episode", f"a second metadata record {name!r}")
            candidates = ours
        chosen[name] = candidates[-1]
    return chosen


def require_version(path: Path, records: Mapping[str, Mapping[str, str]]) -> None:
    """Checks that the metadata are of a version that this reader knows, where they name one.

    Raises:
        ForeignRecordingError: they are of another.
    """
    known = episode_records.SCHEMA_VERSION
    version = records.get("dataset_info", {}).get("schema_version", known)
    if version != known:
        expected = f"a recording of schema version {known}, the latest known here"
        raise ForeignRecordingError(path, expected, f"schema version {version!r} (update copolicy)")


def require_start_digest(path: Path, records: Mapping[str, Mapping[str, str]]) -> bool:
    """Checks the metadata at the start of a recording by the digest among them; whether there is one.

    Raises:
        FileFormatError: they are not what was written.
    """
    digest = records["dataset_info"].get(episode_records.START_DIGEST)
    if digest is not None and digest != episode_records.start_digest(records):
        raise FileFormatError(path, "the metadata that was written at the start", "another")
    return digest is not None


def require_statistics(path: Path, walk: RecordWalk, messages: int) -> None:
    """Checks that the file holds as many records as its summary says, where it says so.

    Args:
        walk: over the whole file.
        messages: that were found, in chunks and outside of them.

    Raises:
        FileFormatError: it holds another number.
    """
    statistics = walk.statistics
    if statistics is None:
        return
    for kind, expected, count in (
        ("messages", statistics.message_count, messages),
        ("chunks", statistics.chunk_count, walk.counts[Opcode.CHUNK]),
        ("attachments", statistics.attachment_count, walk.counts[Opcode.ATTACHMENT]),
        ("metadata records", statistics.metadata_count, walk.counts[Opcode.METADATA]),
    ):
        if expected != count:
            raise FileFormatError(path, f"{expected} {kind}, as its summary counts", str(count))


def channels_text(topics: Iterable[str]) -> str:
    """What a file is that has other channels than ours."""
    names = sorted(set(topics))
    if not names:
        return "an MCAP file without channels"
    more = f" and {len(names) - _TOPICS_SHOWN} more" if len(names) > _TOPICS_SHOWN else ""
    return f"no recording of this task (channels: {', '.join(names[:_TOPICS_SHOWN])}{more})"
