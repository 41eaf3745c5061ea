"""One recording in every layout that the MCAP specification allows, written by the `mcap` library or byte by byte."""

import json
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame
import zstandard
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

MAGIC = b"\x89MCAP0\r\n"
SCHEMA, CHANNEL, MESSAGE, CHUNK, ATTACHMENT, METADATA, DATA_END, FOOTER = 3, 4, 5, 6, 9, 12, 15, 2

NO_INDEX = {
    "index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False, "repeat_channels": False,
    "repeat_schemas": False,
}  # fmt: skip


def library_records(path: Path) -> list[McapRecord]:
    """Everything of a file but its layout, as the `mcap` library reads it."""
    kinds = (Schema, Channel, Message, Metadata, Attachment)
    with path.open("rb") as file:
        return [record for record in StreamReader(file).records if isinstance(record, kinds)]


def write(records: list[McapRecord], target: Path, **options) -> None:
    """Writes records with the `mcap` library, `options` of its writer."""
    with target.open("wb") as file:
        writer = Writer(file, **{"enable_data_crcs": True, **options})
        writer.start(profile="", library="another tool")
        schemas, channels = {0: 0}, {}
        for one in records:
            if isinstance(one, Schema) and one.id not in schemas:
                schemas[one.id] = writer.register_schema(one.name, one.encoding, one.data)
            elif isinstance(one, Channel) and one.id not in channels:
                schema = schemas[one.schema_id]
                channels[one.id] = writer.register_channel(one.topic, one.message_encoding, schema, one.metadata)
            elif isinstance(one, Message):
                writer.add_message(
                    channels[one.channel_id], one.log_time, one.data, one.publish_time, sequence=one.sequence
                )
            elif isinstance(one, Metadata):
                writer.add_metadata(one.name, one.metadata)
            elif isinstance(one, Attachment):
                writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        writer.finish()


def byte_records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and body of every record of a file."""
    position = len(MAGIC)
    while position < len(content) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", content, position)
        yield opcode, content[position + 9 : position + 9 + length]
        position += 9 + length


def write_bytes(records: list[tuple[int, bytes]], target: Path, data_crc: bool) -> None:
    """Writes records of a data section, without a summary."""
    data = MAGIC + b"".join(struct.pack("<BQ", opcode, len(body)) + body for opcode, body in records)
    end = struct.pack("<BQI", DATA_END, 4, zlib.crc32(data) if data_crc else 0)
    target.write_bytes(data + end + struct.pack("<BQQQI", FOOTER, 20, 0, 0, 0) + MAGIC)


def data_section(source: Path) -> list[tuple[int, bytes]]:
    """The records of a file before the end of its data, chunks as they are."""
    records = list(byte_records(source.read_bytes()))
    return records[: next(index for index, (opcode, _) in enumerate(records) if opcode == DATA_END)]


def chunk_content(body: bytes) -> bytes:
    """The records in a chunk of one of our recordings, which is compressed with zstd."""
    return zstandard.decompress(body[32 + 4 + 8 :])


def chunk(body: bytes, compression: str, compress: Callable[[bytes], bytes], crc: bool = True, size=None) -> bytes:
    """The body of a chunk of ours compressed in another way; `size` is what its head says, where that is a lie."""
    content = chunk_content(body)
    stored = compress(content)
    head = body[:16] + struct.pack("<QI", len(content) if size is None else size, zlib.crc32(content) if crc else 0)
    name = compression.encode()
    return head + struct.pack("<I", len(name)) + name + struct.pack("<Q", len(stored)) + stored


def rechunked(source: Path, target: Path, compression: str, compress, crc: bool = True, data_crc: bool = True) -> None:
    """Copies a recording with its chunks compressed in another way."""
    records = [
        (opcode, chunk(body, compression, compress, crc) if opcode == CHUNK else body)
        for opcode, body in data_section(source)
    ]
    write_bytes(records, target, data_crc)


def zstd_stream(content: bytes) -> bytes:
    """A frame that does not say how long its content is, as a writer makes it that streams."""
    return zstandard.ZstdCompressor(write_content_size=False).compress(content)


def zstd_frames(content: bytes) -> bytes:
    """Two frames, which together are one content."""
    half = len(content) // 2
    return zstandard.compress(content[:half]) + zstd_stream(content[half:])


def lz4_stream(content: bytes) -> bytes:
    """A frame of LZ4 without the size of its content, in several blocks."""
    with lz4.frame.LZ4FrameCompressor(block_size=lz4.frame.BLOCKSIZE_MAX64KB) as compressor:
        return compressor.begin() + compressor.compress(content) + compressor.flush()


def without_attachment_sums(source: Path, target: Path) -> None:
    """The attachments, and all else, without check sums."""
    records = [
        (opcode, body[:-4] + bytes(4) if opcode == ATTACHMENT else body) for opcode, body in data_section(source)
    ]
    write_bytes(records, target, data_crc=False)


def declared_outside(source: Path, target: Path) -> None:
    """Schemas and channels before all chunks, an unknown record and an empty chunk among them."""
    records, declarations = [], []
    for opcode, body in data_section(source):
        if opcode == CHUNK:
            inner = byte_records(MAGIC + chunk_content(body) + MAGIC)
            parts = list(inner)
            declarations += [part for part in parts if part[0] in (SCHEMA, CHANNEL)]
            content = b"".join(struct.pack("<BQ", op, len(b)) + b for op, b in parts if op == MESSAGE)
            body = chunk(body[:32] + body[32:], "", lambda _, content=content: content, size=len(content))
            body = body[:24] + struct.pack("<I", zlib.crc32(content)) + body[28:]
        records.append((opcode, body))
    empty = bytes(24) + struct.pack("<IIQ", 0, 0, 0)
    write_bytes([records[0], *declarations, (0x80, b"private"), (CHUNK, empty), *records[1:]], target, data_crc=True)


def camera(first_id: int = 900) -> list[McapRecord]:
    """Records of another project: images and joints as JSON, one channel without a schema, its own metadata."""
    schema = Schema(id=first_id, name="Image", encoding="jsonschema", data=b"{}")
    messages = [
        Message(first_id + number % 3, 5 * number, json.dumps({"n": number}).encode(), 5 * number, 1000 - number)
        for number in range(60)
    ]
    channels = [
        Channel(first_id, "/camera", "json", {}, first_id),
        Channel(first_id + 1, "/joint_states", "json", {"robot": "arm"}, 0),
        Channel(first_id + 2, "/episode/event", "json", {}, first_id),
    ]
    about = [
        *(Metadata("calibration", {"camera": number}) for number in "12"),
        Metadata("dataset_info", {"robot": "arm", "fps": "60", "schema_version": "7"}),
    ]
    return [schema, *channels, *messages, *about, Attachment(1, 2, "urdf.xml", "text/xml", b"<robot/>")]


def _library(change=lambda records: records, **options):
    return lambda source, target: write(change(library_records(source)), target, **options)


def _by_topic(records: list[McapRecord]) -> list[McapRecord]:
    messages = [record for record in records if isinstance(record, Message)]
    end = [record for record in records if isinstance(record, Metadata) and record.name == "episode_result"]
    others = [r for r in records if not isinstance(r, Message) and getattr(r, "name", "") != "episode_result"]
    return others + sorted(messages, key=lambda message: message.channel_id) + end


def _backwards(records: list[McapRecord]) -> list[McapRecord]:
    messages = [record for record in records if isinstance(record, Message)]
    return [record for record in records if not isinstance(record, Message)] + messages[::-1]


def _merged(records: list[McapRecord]) -> list[McapRecord]:
    both = sorted((r for r in [*records, *camera()] if isinstance(r, Message)), key=lambda message: message.log_time)
    return [record for record in [*camera(), *records] if not isinstance(record, Message)] + both


def _filtered(records: list[McapRecord]) -> list[McapRecord]:
    """Only what carries states, actions and events, as after `mcap filter`."""
    kept = {c.id for c in records if isinstance(c, Channel) and c.topic[:5] != "/scen" and c.topic != "/interaction"}
    return [
        record for record in records
        if not (isinstance(record, Channel) and record.id not in kept)
        and not (isinstance(record, Message) and record.channel_id not in kept)
    ]  # fmt: skip


Variant = Callable[[Path, Path], None]

VERIFIED: dict[str, Variant] = {
    "zstd": _library(),
    "uncompressed": _library(compression=CompressionType.NONE),
    "lz4": _library(compression=CompressionType.LZ4),
    "small chunks": _library(chunk_size=500, compression=CompressionType.LZ4),
    "unchunked": _library(use_chunking=False),
    "without a summary": _library(**NO_INDEX),
    "without sums of chunks": _library(enable_crcs=False),
    "merged with another project's": _library(_merged),
    "filtered": _library(_filtered),
    "by topic": _library(_by_topic),
    "backwards": _library(_backwards),
    "zstd without a size": lambda source, target: rechunked(source, target, "zstd", zstd_stream),
    "zstd in two frames": lambda source, target: rechunked(source, target, "zstd", zstd_frames),
    "lz4 without a size": lambda source, target: rechunked(source, target, "lz4", lz4_stream),
    "declared outside of chunks": declared_outside,
}
"""Layouts with a check sum over all data."""

CHUNKS = "chunks carry no check sum: their content could not be verified"
METADATA_NOTE = "the data section carries no check sum: the result of the episode could not be verified"

UNVERIFIED: dict[str, tuple[Variant, tuple[str, ...]]] = {
    "no sum of the data": (_library(enable_data_crcs=False), (METADATA_NOTE,)),
    "no sums": (_library(enable_crcs=False, enable_data_crcs=False), (CHUNKS, METADATA_NOTE)),
    "no sums, no summary": (
        _library(enable_crcs=False, enable_data_crcs=False, compression=CompressionType.LZ4, **NO_INDEX),
        (CHUNKS, METADATA_NOTE),
    ),
    "unchunked, no sums": (
        _library(use_chunking=False, enable_crcs=False, enable_data_crcs=False),
        ("messages outside of chunks carry no check sum", METADATA_NOTE),
    ),
    "no sums of attachments": (without_attachment_sums, ("the map carries no check sum", METADATA_NOTE)),
    "zstd without size or sums": (
        lambda source, target: rechunked(source, target, "zstd", zstd_stream, crc=False, data_crc=False),
        (CHUNKS, METADATA_NOTE),
    ),
}  # fmt: skip
"""Layouts that lack check sums, with what a reader must say of them."""
