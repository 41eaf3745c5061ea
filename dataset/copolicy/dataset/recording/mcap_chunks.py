"""Reads chunks of an MCAP file: bounded decompression, verification of the check sum, iteration over messages.

Format: https://mcap.dev/spec. The decompressors are those of the `mcap` library.
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
"""Largest chunk that is read, bytes, both stored and decompressed; the recorder writes chunks of 1 MiB."""

MESSAGE_HEAD = 22
"""Bytes before the payload in the body of a message: channel, sequence, log time, publish time."""

_HEAD_SIZE = 9  # opcode, length of the body
_IN_CHUNK = struct.Struct("<BQH")  # opcode, length, and the channel of a message


class UnreadChunkError(ValueError):
    """A chunk is too large or has an unknown compression; it need not be damaged."""


class ChunkRecords(NamedTuple):
    """The decompressed records of a chunk, and whether a check sum verified them."""

    data: bytes
    verified: bool


def chunk_records(body: bytes) -> ChunkRecords:
    """Decompresses and verifies the body of a chunk.

    Raises:
        ValueError: the chunk fails its check sum or contradicts its header.
        UnreadChunkError: the chunk is too large, or its compression is unknown.
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
        raise ValueError("a chunk whose size contradicts its header")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk that fails its check sum")
    return ChunkRecords(data, chunk.uncompressed_crc != 0)


def _zstd(compressed: bytes, size: int) -> bytes:
    """At most `size + 1` bytes; does not trust the content size stated in the frame, to bound the memory."""
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
    """Passes the messages of a chunk to the handlers of their channels; skips other messages without decoding.

    Args:
        data: decompressed records of the chunk.
        handlers: functions of a message's payload, by channel.
        declare: function of opcode and body of every other record, such as schemas and channels; may extend `handlers`.

    Returns:
        Number of messages, including skipped ones.

    Raises:
        ValueError: a record extends beyond the chunk or is too short.
    """
    unpack, handler_of, message = _IN_CHUNK.unpack_from, handlers.get, int(Opcode.MESSAGE)
    position, end, messages = 0, len(data), 0
    data += bytes(2)  # padding, so that the channel can be unpacked for any record
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
