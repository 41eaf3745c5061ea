"""A chunk of an MCAP file: decompressed within bounds, verified where it carries a check sum, and walked.

Format: https://mcap.dev/spec. The decompressors are those that the `mcap` library itself brings.
"""

import struct
import zlib
from collections.abc import Callable, Mapping
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk

LARGEST_CHUNK = 64 << 20
"""Bytes of a chunk, as it is stored and decompressed, that are worth holding in memory; our recorder's have 1 MiB."""

MESSAGE_HEAD = 22
"""Bytes before the payload in the body of a message: channel, sequence, log time, publish time."""

_HEAD_SIZE = 9  # opcode, length of the body
_IN_CHUNK = struct.Struct("<BQH")  # the same, and the channel where it is a message


class UnreadChunkError(ValueError):
    """A chunk that may be sound, but is larger or compressed otherwise than what is read here."""


class ChunkRecords(NamedTuple):
    """The records in a chunk, decompressed, and whether a check sum of the chunk vouches for them."""

    data: bytes
    verified: bool


def chunk_records(body: bytes) -> ChunkRecords:
    """The records in the body of a chunk.

    Raises:
        ValueError: the chunk fails its check sum or is not what its head says.
        UnreadChunkError: it is too large, or its compression is unknown.
    """
    chunk = Chunk.read(ReadDataStream(BytesIO(body)))
    size = chunk.uncompressed_size
    if size > LARGEST_CHUNK:
        raise UnreadChunkError(f"a chunk of {size} bytes")
    if chunk.compression == "zstd":
        data = _zstd(chunk.data, size)
    elif chunk.compression == "lz4":
        data = _lz4(chunk.data, size)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise UnreadChunkError(f"a chunk compressed with {chunk.compression!r}")
    if len(data) != size:
        raise ValueError("a chunk of another size than its head says")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk that fails its check sum")
    return ChunkRecords(data, chunk.uncompressed_crc != 0)


def _zstd(compressed: bytes, size: int) -> bytes:
    """At most `size + 1` bytes: what a frame says of its content, if anything, decides about no allocation."""
    with zstandard.ZstdDecompressor().stream_reader(compressed, read_across_frames=True) as stream:
        return _read_up_to(stream.read, size + 1)


def _lz4(compressed: bytes, size: int) -> bytes:
    with lz4.frame.LZ4FrameFile(BytesIO(compressed)) as stream:
        return _read_up_to(stream.read, size + 1)


def _read_up_to(read: Callable[[int], bytes], size: int) -> bytes:
    parts, missing = [], size
    while missing and (part := read(missing)):
        parts.append(part)
        missing -= len(part)
    return b"".join(parts)


def walk_chunk(
    data: bytes, handlers: Mapping[int, Callable[[bytes], None]], declare: Callable[[int, bytes], None]
) -> int:
    """Hands out the messages of a chunk without touching those of channels that nobody wants.

    Args:
        data: the chunk's records, decompressed.
        handlers: for each wanted channel, what takes the payload of its messages.
        declare: takes opcode and body of each other record, schemas and channels first of all; may add to `handlers`.

    Returns:
        The number of messages.

    Raises:
        ValueError: a record leaves the chunk or is shorter than its kind allows.
    """
    unpack, handler_of, message = _IN_CHUNK.unpack_from, handlers.get, int(Opcode.MESSAGE)
    position, end, messages = 0, len(data), 0
    data += bytes(2)  # so that the last record, too, can be looked at as if it were a message
    while position < end:
        if end - position < _HEAD_SIZE:
            raise ValueError("a record that leaves its chunk")
        opcode, length, channel = unpack(data, position)
        begin = position + _HEAD_SIZE
        position = begin + length
        if position > end:
            raise ValueError("a record that leaves its chunk")
        if opcode == message:
            if length < MESSAGE_HEAD:
                raise ValueError(f"a message of {length} bytes")
            messages += 1
            handler = handler_of(channel)
            if handler is not None:
                handler(data[begin + MESSAGE_HEAD : position])
        else:
            declare(opcode, data[begin:position])
    return messages
