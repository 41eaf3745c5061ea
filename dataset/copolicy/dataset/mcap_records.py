"""Walks the records of an MCAP file from its first byte to its last, verifying every check sum on the way.

The library's readers either trust the summary at the end of a file or hold a whole attachment in memory, and none
of them verifies the summary; this walk holds one record at a time. Format: https://mcap.dev/spec
"""

import hashlib
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata
from mcap.writer import MCAP0_MAGIC

from .exceptions import FileFormatError

_HEAD = struct.Struct("<BQ")  # opcode, length of the body
_IN_CHUNK = struct.Struct("<BQH")  # the same, and the channel where it is a message
_FOOTER_SIZE = 20  # start of the summary, start of its offsets, check sum
_BLOCK = 1 << 20
_LARGEST_CHUNK = 64 << 20  # our recorder starts a new chunk at 1 MiB

MESSAGE_HEAD = 22
"""Bytes before the payload in the body of a message: channel, sequence, log time, publish time."""


class RecordWalk:
    """One pass over an open file.

    Attributes:
        sha256: hexadecimal digest of the file; final once `records` is exhausted.
        offset: bytes read so far.
    """

    def __init__(self, path: Path, file: BinaryIO, size: int):
        self._path, self._file, self._size = path, file, size
        self._sha256 = hashlib.sha256()
        self._crc = 0
        self.offset = 0

    @property
    def sha256(self) -> str:
        return self._sha256.hexdigest()

    def records(self, largest: Mapping[int, int]) -> Iterator[tuple[int, bytes]]:
        """Opcode and body of the records of the data section.

        Args:
            largest: the opcodes that are wanted, each with the largest body that is worth holding in memory, bytes.

        Raises:
            FileFormatError: the file is cut short, is followed by something, or fails a check sum.
        """
        if self._read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise self.damage("another beginning")
        in_data = True
        while True:
            data_crc = self._crc
            opcode, length = _HEAD.unpack(self._read(_HEAD.size))
            if opcode == Opcode.FOOTER:
                break
            if length > self._size - self.offset:
                raise self.damage(f"a record of {length} bytes")
            if opcode == Opcode.DATA_END and in_data:
                (expected,) = struct.unpack("<I", self._read(length))
                # Zero would mean "not computed"; then nothing vouches for metadata and attachments.
                if expected != data_crc:
                    raise self.damage(f"a data section with check sum {data_crc:08x} instead of {expected:08x}")
                in_data, self._crc = False, 0
            elif in_data and length <= largest.get(opcode, -1):
                yield opcode, self._read(length)
            else:
                self._skip(length)
        if in_data or length != _FOOTER_SIZE:
            raise self.damage("a footer without an end of the data section")
        self._read(_FOOTER_SIZE - 4)
        summary_crc = self._crc
        (expected,) = struct.unpack("<I", self._read(4))
        if expected not in (0, summary_crc):
            raise self.damage(f"a summary with check sum {summary_crc:08x} instead of {expected:08x}")
        if self._read(len(MCAP0_MAGIC)) != MCAP0_MAGIC or self.offset != self._size:
            raise self.damage("another end")

    def damage(self, found: str) -> FileFormatError:
        """The error for something found at the current position."""
        return FileFormatError(self._path, "an intact and complete MCAP file", f"{found} at byte {self.offset}")

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


def chunk_data(body: bytes) -> bytes:
    """The records in a chunk, decompressed.

    Raises:
        ValueError: the chunk fails its check sum or is not what its head says.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    if chunk.uncompressed_size > _LARGEST_CHUNK:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
    if chunk.compression == "zstd":
        # The size in the frame decides how much is allocated, whatever else the call is told.
        if zstandard.frame_content_size(chunk.data) != chunk.uncompressed_size:
            raise ValueError("a chunk of another size than its head says")
        data = zstandard.ZstdDecompressor().decompress(chunk.data)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"a chunk compressed with {chunk.compression!r}")
    if len(data) != chunk.uncompressed_size or chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk that fails its check sum")
    return data


def walk_chunk(
    data: bytes, handlers: Mapping[int, Callable[[bytes], None]], declare: Callable[[int, bytes], None]
) -> None:
    """Hands out the messages of a chunk without touching those of channels that nobody wants.

    Args:
        data: the chunk's records, decompressed.
        handlers: for each wanted channel, what takes the payload of its messages.
        declare: takes opcode and body of each schema and channel; may add to `handlers`.
    """
    unpack, handler_of, message = _IN_CHUNK.unpack_from, handlers.get, int(Opcode.MESSAGE)
    position, end = 0, len(data)
    while position < end:
        opcode, length, channel = unpack(data, position)
        begin = position + _HEAD.size
        position = begin + length
        if position > end:
            raise ValueError("a record that leaves its chunk")
        if opcode == message:
            handler = handler_of(channel)
            if handler is not None:
                handler(data[begin + MESSAGE_HEAD : position])
        else:
            declare(opcode, data[begin:position])


def metadata_records(path: Path) -> dict[str, dict[str, str]]:
    """The metadata records of a file, finished or not, by name; the last of a name wins.

    Reads the head of each record and seeks past everything else (about a millisecond for an episode), so it also
    works where a recording broke off and there is no summary to consult. No check sum is verified.

    Raises:
        FileFormatError: no MCAP file.
    """
    found: dict[str, dict[str, str]] = {}
    size = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise FileFormatError(path, "an MCAP file", "another beginning")
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            opcode, length = _HEAD.unpack(head)
            if opcode in (Opcode.DATA_END, Opcode.FOOTER) or length > size - file.tell():
                break
            if opcode == Opcode.METADATA:
                record = Metadata.read(ReadDataStream(BytesIO(file.read(length))))
                found[record.name] = record.metadata
            else:
                file.seek(length, 1)
    return found
