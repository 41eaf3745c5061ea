"""The MCAP file of a recording, named `NAME.mcap.part` until it is complete and on the disk."""

import os
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from copolicy.dataset.exceptions import OutputExistsError
from copolicy.dataset.files.lock import lock
from copolicy.dataset.files.staging import sync_folder
from copolicy.dataset.recording.topics import ENCODING, Topic, schema_data

PART_SUFFIX = ".part"
"""Suffix of an incomplete recording: one that still runs, or was interrupted."""

_CHUNK_SIZE = 1 << 20


class EpisodeFile:
    """Writes one MCAP file.

    Chunks have 1 MiB and zstd compression. `enable_data_crcs` adds a check sum over every byte, without which a flipped
    bit in a metadata record would not be detected.
    """

    def __init__(self, path: Path):
        """Opens `path` + `.part`.

        Raises:
            OutputExistsError: the file or an incomplete recording of the same name exists.
        """
        self.path = path
        if path.exists():
            raise OutputExistsError(path)
        try:
            self._file = self.part.open("xb")
        except FileExistsError:
            raise OutputExistsError(self.part) from None
        lock(self._file, wait=True)  # by which `recover` detects a running recording
        self._writer = Writer(
            self._file, chunk_size=_CHUNK_SIZE, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        self._writer.start(library=f"copolicy/{version('lerobot_policy_copolicy')} {LIBRARY_IDENTIFIER}")
        self._channels: dict[str, int] = {}

    @property
    def part(self) -> Path:
        """Path of the file until it is published."""
        return self.path.with_name(self.path.name + PART_SUFFIX)

    def declare(self, topics: Iterable[Topic]) -> None:
        """Writes the schema and the channel of each topic."""
        schemas: dict[str, int] = {}
        for topic in topics:
            name = topic.schema_name
            if name not in schemas:
                schemas[name] = self._writer.register_schema(name, ENCODING, schema_data(topic.message))
            self._channels[topic.name] = self._writer.register_channel(
                topic.name, ENCODING, schemas[name], topic.metadata
            )

    def add_metadata(self, name: str, entries: dict[str, str]) -> None:
        """Writes a metadata record."""
        self._writer.add_metadata(name, entries)

    def add_attachment(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Writes an attachment."""
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)

    def add(self, topic: Topic, payload: bytes, time_ns: int, sequence: int) -> None:
        """Writes a serialised message; `time_ns` is UTC, nanoseconds since 1970."""
        self._writer.add_message(self._channels[topic.name], time_ns, payload, time_ns, sequence)

    def flush(self) -> None:
        """Passes all data to the operating system, so that a killed process loses only later data."""
        self._writer.flush()

    def complete(self) -> None:
        """Writes the summary and syncs the file to the disk, still as `.part`."""
        self._writer.finish()
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def publish(self) -> None:
        """Renames the complete file to its final name.

        Raises:
            OutputExistsError: another file has taken the name meanwhile; the recording stays a `.part`.
        """
        if self.path.exists():
            raise OutputExistsError(self.path)
        os.replace(self.part, self.path)
        sync_folder(self.path.parent)

    def close(self) -> None:
        """Closes the file without completing it."""
        self._file.close()
