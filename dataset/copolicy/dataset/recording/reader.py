"""Reads a recording: one MCAP file to one `Episode`, bit-identical to what was recorded.

Every command reads recordings through this module: it reads any layout that the format allows, verifies all check sums,
and checks the structure of parts without a check sum, which it uses and lists in `Episode.notes`.
"""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from ..episode import Episode
from ..exceptions import CopolicyError, FileFormatError, ForeignRecordingError, UnknownNameError
from ..files.file_kinds import describe_path
from ..task import PairTask, get_task, installed_tasks
from . import episode_records
from .episode_builder import EpisodeBuilder
from .mcap_chunks import LARGEST_CHUNK, UnreadChunkError
from .mcap_records import RecordWalk, metadata_records, walk_metadata
from .messages.copolicy_pb2 import EpisodeEvent

_LARGEST: dict[int, int] = {
    Opcode.SCHEMA: 1 << 20,
    Opcode.CHANNEL: 1 << 20,
    Opcode.MESSAGE: 1 << 20,
    Opcode.METADATA: 1 << 20,
    Opcode.ATTACHMENT: 1 << 20,  # the scenario is small; larger attachments such as videos are skipped
    Opcode.CHUNK: LARGEST_CHUNK,
}


@dataclass(frozen=True)
class Recording:
    """The content of a recording.

    Attributes:
        episode: states, actions, metadata and scenario.
        events: events in order of their steps.
    """

    episode: Episode
    events: tuple[EpisodeEvent, ...]


def read_recording(path: Path | str) -> Recording:
    """Reads the episode and the events of a recording.

    Reads the file once, one chunk at a time, and decodes only states, actions and events. Verifies the check sums of
    chunks, attachments, data section and summary if present, the counts of the summary, the metadata and the scenario,
    and that every step from 0 has one state and two actions, with one more state at the end. `meta.source_sha256` is
    the digest of the file; `meta.physics` and `meta.obstacle_size` are from the record `physics` and the scenario;
    `notes` list the parts without a check sum.

    Raises:
        FileFormatError: the file is unreadable, damaged or incomplete.
        ForeignRecordingError: the file is of another project, of a task that is not installed, or of an unknown schema
            version.
    """
    path = Path(path)
    with _as_format_error(path), path.open("rb") as file:
        walk = RecordWalk(path, file, path.stat().st_size)
        builder = EpisodeBuilder(path, recorded_task(path))
        unread = ""
        for opcode, body in walk.records(_LARGEST):
            try:
                builder.add_record(opcode, body)
            except UnreadChunkError as error:
                unread = unread or str(error)  # raised below if the file is a recording of this task
            except Exception as error:
                # Damaged bytes cause errors of any parser (struct, zstd, protobuf, UTF-8, ...).
                raise walk.damage(f"damage ({error or type(error).__name__}) in the record that ends") from None
        builder.require_this_task(walk.summary_topics)
        if walk.largest_skipped > LARGEST_CHUNK:
            unread = f"a chunk of {walk.largest_skipped} bytes"
        if unread:
            expected = f"chunks of at most {LARGEST_CHUNK >> 20} MiB, compressed with zstd, lz4 or nothing"
            raise FileFormatError(path, expected, unread)
        return Recording(builder.episode(walk), builder.events)


def read_episode(path: Path | str) -> Episode:
    """Reads the episode of a recording, see `read_recording`.

    Raises:
        FileFormatError: the file is unreadable, damaged, incomplete or not a recording of an installed task.
    """
    return read_recording(path).episode


def recorded_task(path: Path) -> PairTask:
    """The task of a recording, also of an unfinished one; the table task if the metadata state none.

    Raises:
        ForeignRecordingError: the task is not installed.
    """
    name = "table"
    # Damage is reported when the whole file is read.
    with contextlib.suppress(Exception):
        records = (record.metadata for record in walk_metadata(path) if record.name == "dataset_info")
        info = next(info for info in records if episode_records.START_DIGEST in info)
        name = info.get(episode_records.TASK, name)
    try:
        return get_task(name)
    except UnknownNameError:
        installed = ", ".join(installed_tasks())
        raise ForeignRecordingError(
            path, f"a recording of a task that is installed ({installed})", f"one of {name!r}"
        ) from None


def read_metadata(path: Path | str) -> dict[str, dict[str, str]]:
    """Reads the metadata records of a recording by name, without verifying the file, in about a millisecond.

    An unfinished recording has the records that are written at its start.

    Raises:
        FileFormatError: the file is unreadable or not an MCAP file.
    """
    path = Path(path)
    with _as_format_error(path):
        return metadata_records(path)


@contextlib.contextmanager
def _as_format_error(path: Path) -> Iterator[None]:
    if path.exists() and not path.is_file():
        raise FileFormatError(path, "an MCAP file", describe_path(path))
    try:
        yield
    except FileFormatError:
        raise
    except CopolicyError as error:
        raise FileFormatError(path, "a recording of this task", str(error)) from None
    except OSError as error:
        raise FileFormatError(path, "a readable MCAP file", error.strerror or str(error)) from None
    except Exception as error:
        raise FileFormatError(path, "an intact MCAP file", str(error) or type(error).__name__) from None
