"""Reads a recording: one MCAP file to one `Episode`, bit for bit as it was recorded, or not at all.

Every command reads recordings through this module, so that one rule holds for all: whatever layout the format allows
is read, every check sum that the file carries is verified, and what carries none is checked for its structure, used
as it stands, and named in `Episode.notes`.
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
from .contents import RecordingContents
from .mcap_chunks import LARGEST_CHUNK, UnreadChunkError
from .mcap_records import RecordWalk, metadata_records, walk_metadata
from .messages.copolicy_pb2 import EpisodeEvent

_LARGEST: dict[int, int] = {
    Opcode.SCHEMA: 1 << 20,
    Opcode.CHANNEL: 1 << 20,
    Opcode.MESSAGE: 1 << 20,
    Opcode.METADATA: 1 << 20,
    Opcode.ATTACHMENT: 1 << 20,  # the map is small; a video beside it is read past
    Opcode.CHUNK: LARGEST_CHUNK,
}


@dataclass(frozen=True)
class Recording:
    """What a recording holds.

    Attributes:
        episode: its states, actions, metadata and map.
        events: what happened, by step.
    """

    episode: Episode
    events: tuple[EpisodeEvent, ...]


def read_recording(path: Path | str) -> Recording:
    """The episode in a recording, and what happened in it.

    Reads the file once, one chunk at a time, decodes nothing but states, actions and events, and verifies all that
    can be: the check sums of chunks, attachments, data section and summary where there are any, the counts of the
    summary, that every step from 0 has one state and two actions and the last one a state after it, the metadata,
    and the scenario. `meta.source_sha256` is the digest of the file, `meta.physics` and
    `meta.obstacle_size` are those of its record `physics` and of its scenario; `notes` say what carries no check sum.

    Raises:
        FileFormatError: the file cannot be read, is damaged or incomplete.
        ForeignRecordingError: it is another project's, of a task that is not installed, or of a version
            that this reader does not know.
    """
    path = Path(path)
    with _as_format_error(path), path.open("rb") as file:
        walk = RecordWalk(path, file, path.stat().st_size)
        contents = RecordingContents(path, recorded_task(path))
        unread = ""
        for opcode, body in walk.records(_LARGEST):
            try:
                contents.take(opcode, body)
            except UnreadChunkError as error:
                unread = unread or str(error)  # the end of the file tells whether it matters
            except Exception as error:
                # Damaged bytes fail in as many ways as there are parsers (struct, zstd, protobuf, UTF-8, ...).
                raise walk.damage(f"damage ({error or type(error).__name__}) in the record that ends") from None
        contents.require_this_task(walk.summary_topics)
        if walk.passed_by > LARGEST_CHUNK:
            unread = f"a chunk of {walk.passed_by} bytes"
        if unread:
            expected = f"chunks of at most {LARGEST_CHUNK >> 20} MiB, compressed with zstd, lz4 or nothing"
            raise FileFormatError(path, expected, unread)
        return Recording(contents.episode(walk), contents.events)


def read_episode(path: Path | str) -> Episode:
    """The episode in a recording: what `read_recording` reads, without the events.

    Raises:
        FileFormatError: see `read_recording`.
    """
    return read_recording(path).episode


def recorded_task(path: Path) -> PairTask:
    """The task of a recording, finished or not, as its metadata name it; the table where they name none.

    Raises:
        ForeignRecordingError: the task is not installed.
    """
    name = "table"
    # Whoever reads the whole file says what is damaged.
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
    """The metadata records of a recording by name, in about a millisecond and without verifying the file.

    Works on a recording that broke off, too: what is written at its start is there.

    Raises:
        FileFormatError: the file cannot be read or is no MCAP file.
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
