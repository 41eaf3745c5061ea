"""Reads the records of an MCAP file sequentially and verifies all check sums.

The readers of the `mcap` library either trust the summary at the end of a file or load whole attachments, and do not
verify the summary; this reader loads one record at a time. Format: https://mcap.dev/spec; a check sum of 0 means that
none was computed.
"""

import hashlib
import struct
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Statistics
from mcap.writer import MCAP0_MAGIC

from ..exceptions import FileFormatError
from ..files.file_kinds import describe_path

_HEAD = struct.Struct("<BQ")  # opcode, length of the body
_FOOTER_SIZE = 20  # start of the summary, start of its offsets, check sum
_BLOCK = 1 << 20
_LARGEST = 1 << 20  # bytes, of a summary or metadata record that is read


class RecordWalk:
    """One pass over an open file.

    Attributes:
        sha256: hexadecimal digest of the file; complete after `records` is exhausted.
        offset: bytes read so far.
        counts: number of records of the data section by opcode, read or skipped.
        largest_skipped: size of the largest requested record that was too large to read, bytes.
        data_verified: whether a check sum verified the data section; False if it has none.
        statistics: the statistics record of the summary; None if it has none.
        summary_topics: topics of the channels in the summary.
    """

    def __init__(self, path: Path, file: BinaryIO, size: int):
        self._path, self._file, self._size = path, file, size
        self._sha256 = hashlib.sha256()
        self._crc = 0
        self.offset = 0
        self.counts: Counter[int] = Counter()
        self.largest_skipped = 0
        self.data_verified = False
        self.statistics: Statistics | None = None
        self.summary_topics: list[str] = []

    @property
    def sha256(self) -> str:
        return self._sha256.hexdigest()

    def records(self, largest: Mapping[int, int]) -> Iterator[tuple[int, bytes]]:
        """Iterates over opcode and body of the records of the data section.

        Args:
            largest: requested opcodes, each with the largest body to read, bytes.

        Raises:
            FileFormatError: not an MCAP file, or a truncated one, one with trailing bytes or a wrong check sum.
        """
        self._read_magic()
        in_data = True
        while True:
            crc = self._crc
            opcode, length = _HEAD.unpack(self._read(_HEAD.size))
            if opcode == Opcode.FOOTER:
                break
            if length > self._size - self.offset:
                raise self.damage(f"a record of {length} bytes")
            if opcode == 0:
                raise self.damage("a record without a kind")
            if not in_data:
                self._read_summary_record(opcode, length)
            elif opcode == Opcode.DATA_END:
                self._end_data(crc, self._read(length))
                in_data, self._crc = False, 0
            else:
                self.counts[opcode] += 1
                if length <= largest.get(opcode, -1):
                    yield opcode, self._read(length)
                else:
                    self.largest_skipped = max(self.largest_skipped, length if opcode in largest else 0)
                    self._skip(length)
        if in_data or length != _FOOTER_SIZE:
            raise self.damage("a footer without an end of the data section")
        self._read(_FOOTER_SIZE - 4)
        summary_crc = self._crc
        (expected,) = struct.unpack("<I", self._read(4))
        if expected not in (0, summary_crc):
            raise self.damage(f"a summary with check sum {summary_crc:08x} instead of {expected:08x}")
        if self._read(len(MCAP0_MAGIC)) != MCAP0_MAGIC or self.offset != self._size:
            raise self.damage("a wrong end of the file")

    def damage(self, finding: str) -> FileFormatError:
        """The error for damage at the current position."""
        return FileFormatError(self._path, "an intact and complete MCAP file", f"{finding} at byte {self.offset}")

    def _read_magic(self) -> None:
        magic = self._file.read(len(MCAP0_MAGIC))
        self._file.seek(0)
        if not magic or not MCAP0_MAGIC.startswith(magic):
            raise FileFormatError(self._path, "an MCAP file", describe_path(self._path))
        self._read(len(MCAP0_MAGIC))

    def _end_data(self, crc: int, body: bytes) -> None:
        if len(body) < 4:
            raise self.damage("an end of the data section without its check sum")
        (expected,) = struct.unpack_from("<I", body)
        if expected not in (0, crc):
            raise self.damage(f"a data section with check sum {crc:08x} instead of {expected:08x}")
        self.data_verified = expected != 0

    def _read_summary_record(self, opcode: int, length: int) -> None:
        if opcode not in (Opcode.STATISTICS, Opcode.CHANNEL) or length > _LARGEST:
            self._skip(length)
            return
        stream = ReadDataStream(BytesIO(self._read(length)))
        try:
            if opcode == Opcode.STATISTICS:
                self.statistics = Statistics.read(stream)
            else:
                self.summary_topics.append(Channel.read(stream).topic)
        except Exception as error:  # damaged bytes cause many types of errors
            raise self.damage(f"damage ({error or type(error).__name__}) in the summary record that ends") from None

    def _read(self, length: int) -> bytes:
        data = self._file.read(length)
        if len(data) != length:
            raise self.damage("its end")
        self._crc = zlib.crc32(data, self._crc)
        self._sha256.update(data)
        self.offset += length
        return data

    def _skip(self, length: int) -> None:
        while length:
            length -= len(self._read(min(length, _BLOCK)))


def metadata_records(path: Path) -> dict[str, dict[str, str]]:
    """The metadata records of a file by name; of equal names the last.

    Reads only record headers and metadata (about a millisecond per episode), so it also works for an unfinished
    recording without summary. Verifies no check sums.

    Raises:
        FileFormatError: not an MCAP file.
    """
    return {record.name: record.metadata for record in walk_metadata(path)}


def walk_metadata(path: Path) -> Iterator[Metadata]:
    """Iterates over the metadata records of a file, see `metadata_records`."""
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise FileFormatError(path, "an MCAP file", describe_path(path))
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            opcode, length = _HEAD.unpack(head)
            if opcode in (0, Opcode.DATA_END, Opcode.FOOTER) or length > size - file.tell():
                break
            if opcode == Opcode.METADATA and length <= _LARGEST:
                yield Metadata.read(ReadDataStream(BytesIO(file.read(length))))
            else:
                file.seek(length, 1)
