"""Reads a recording: one MCAP file to one `Episode`, bit for bit as it was recorded, or not at all."""

import contextlib
import math
from array import array
from collections.abc import Callable, Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from . import episode_records
from .episode import Episode
from .exceptions import CopolicyError, FileFormatError
from .mcap_records import MESSAGE_HEAD, RecordWalk, chunk_data, metadata_records, walk_chunk
from .messages.copolicy_pb2 import PlayerAction, TableState
from .physics_text import physics_text
from .task import RECORD_HZ, MapConfig
from .topics import ACTIONS, ENCODING, TABLE_STATE, Topic, schema_difference

_LARGEST: dict[int, int] = {
    Opcode.SCHEMA: 1 << 20,
    Opcode.CHANNEL: 1 << 20,
    Opcode.MESSAGE: 1 << 20,
    Opcode.METADATA: 1 << 20,
    Opcode.ATTACHMENT: 1 << 20,  # the map is small; a video beside it is read past
    Opcode.CHUNK: 64 << 20,
}


def read_episode(path: Path | str) -> Episode:
    """The episode in a recording.

    Reads the file once, one chunk at a time, decodes nothing but states and actions, and verifies all there is:
    the check sums of chunks, data section and summary, that every step from 0 has one state and two actions and
    the last one a state after it, the metadata, and the map. `meta.source_sha256` is the digest of the file,
    `meta.physics` and `meta.obstacle_size` are those of its record `physics` and of its map.

    Raises:
        FileFormatError: the file cannot be read, is damaged, incomplete, or no recording of this task.
    """
    path = Path(path)
    with _as_format_error(path), path.open("rb") as file:
        walk = RecordWalk(path, file, path.stat().st_size)
        contents = _Contents()
        for opcode, body in walk.records(_LARGEST):
            try:
                contents.take(opcode, body)
            except CopolicyError as error:
                raise FileFormatError(path, "a recording of this task", str(error)) from None
            except Exception as error:
                # Damaged bytes fail in as many ways as there are parsers (struct, zstd, protobuf, UTF-8, ...).
                raise walk.damage(f"damage ({error or type(error).__name__}) in the record that ends") from None
        return contents.episode(path, walk.sha256)


def read_metadata(path: Path | str) -> dict[str, dict[str, str]]:
    """The metadata records of a recording by name, in about a millisecond and without verifying the file.

    Works on a recording that broke off, too: what is written at its start is there.

    Raises:
        FileFormatError: the file cannot be read or is no MCAP file.
    """
    path = Path(path)
    with _as_format_error(path):
        return metadata_records(path)


class _Contents:
    """What a walk over a file has collected so far: 88 bytes a step, whatever else the file holds."""

    def __init__(self):
        self._schemas: dict[int, Schema] = {}
        self._handlers: dict[int, Callable[[bytes], None]] = {}
        self._records: dict[str, dict[str, str]] = {}
        self._map: MapConfig | None = None
        self._steps = {topic.name: array("q") for topic in (TABLE_STATE, *ACTIONS)}
        self._values = {topic.name: array("d") for topic in (TABLE_STATE, *ACTIONS)}

    def take(self, opcode: int, body: bytes) -> None:
        """Keeps what matters of one record of the data section."""
        if opcode == Opcode.CHUNK:
            walk_chunk(chunk_data(body), self._handlers, self._declare)
        elif opcode == Opcode.MESSAGE:
            handler = self._handlers.get(int.from_bytes(body[:2], "little"))
            if handler is not None:
                handler(body[MESSAGE_HEAD:])
        elif opcode == Opcode.METADATA:
            record = Metadata.read(ReadDataStream(BytesIO(body)))
            if record.name in self._records:
                raise ValueError(f"a second metadata record {record.name!r}")
            self._records[record.name] = record.metadata
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(ReadDataStream(BytesIO(body)))
            if attachment.name == episode_records.MAP_ATTACHMENT:
                self._map = MapConfig.from_json(attachment.data)
        else:
            self._declare(opcode, body)

    def _declare(self, opcode: int, body: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(body)))
            self._schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(body)))
            for topic in (TABLE_STATE, *ACTIONS):
                if topic.name == channel.topic:
                    schema = self._schemas[channel.schema_id]
                    _check_schema(channel, schema, topic)
                    self._handlers[channel.id] = self._handler(topic)

    def _handler(self, topic: Topic) -> Callable[[bytes], None]:
        step, extend = self._steps[topic.name].append, self._values[topic.name].extend
        if topic is TABLE_STATE:
            parse_state = TableState.FromString

            def take_state(payload: bytes) -> None:
                state = parse_state(payload)
                step(state.step)
                extend((state.x, state.y, state.theta, state.vx, state.vy, state.omega))

            return take_state
        parse_action = PlayerAction.FromString

        def take_action(payload: bytes) -> None:
            action = parse_action(payload)
            step(action.step)
            extend((action.fx, action.fy))

        return take_action

    def episode(self, path: Path, sha256: str) -> Episode:
        """The episode, once the whole file has been walked."""
        meta = episode_records.decode(self._records)
        physics = episode_records.decode_physics(self._records)
        if self._map is None:
            raise FileFormatError(path, f"an attachment {episode_records.MAP_ATTACHMENT!r}", "none")
        fps = self._records["dataset_info"].get("fps")
        if fps != str(RECORD_HZ):
            raise FileFormatError(path, f"a recording at {RECORD_HZ} Hz", f"fps {fps!r}")
        steps = len(self._steps[TABLE_STATE.name]) - 1
        if self._records[episode_records.RESULT].get("steps") != str(steps):
            told = self._records[episode_records.RESULT].get("steps")
            raise FileFormatError(path, f"states of {told} steps and the final one", f"{steps + 1} states")
        for topic, count in ((TABLE_STATE, steps + 1), *((topic, steps) for topic in ACTIONS)):
            found = np.asarray(self._steps[topic.name])
            if not np.array_equal(found, np.arange(count)):
                raise FileFormatError(path, f"steps 0 to {count - 1} in {topic.name}", _first_gap(found, count))
        table = np.asarray(self._values[TABLE_STATE.name]).reshape(-1, 6)
        actions = np.hstack([np.asarray(self._values[topic.name]).reshape(-1, 2) for topic in ACTIONS])
        if not np.isfinite(table).all():
            raise FileFormatError(path, "finite states", "others")
        if not (np.abs(actions) <= 1).all():
            raise FileFormatError(path, "actions in [-1, 1]", "others")
        states = _state_vectors(table)
        seen = {"source_sha256": sha256, "physics": physics_text(physics), "obstacle_size": self._map.obstacle_size}
        meta = replace(meta, **seen)
        return Episode(states[:-1], actions, states[-1], meta, self._map, RECORD_HZ, physics)


def _check_schema(channel: Channel, schema: Schema, topic: Topic) -> None:
    found = (channel.message_encoding, schema.encoding, schema.name)
    if found != (ENCODING, ENCODING, topic.schema_name):
        raise ValueError(f"{topic.name} with encodings and schema {found}")
    difference = schema_difference(schema.data, topic.message)
    if difference:
        raise ValueError(f"{topic.name} with {difference}")


def _first_gap(steps: np.ndarray, count: int) -> str:
    if len(steps) != count:
        return f"{len(steps)} messages"
    place = int(np.flatnonzero(steps != np.arange(count))[0])
    return f"step {steps[place]} in place {place}"


def _state_vectors(table: np.ndarray) -> np.ndarray:
    """`(T, 6)` x, y, theta, velocity to `(T, 7)`, with the same cosine as `features.state_vector`, to the last bit."""
    thetas = table[:, 2].tolist()
    states = np.empty((len(table), 7))
    states[:, :2] = table[:, :2]
    states[:, 2] = [math.cos(theta) for theta in thetas]
    states[:, 3] = [math.sin(theta) for theta in thetas]
    states[:, 4:] = table[:, 3:]
    return states


@contextlib.contextmanager
def _as_format_error(path: Path) -> Iterator[None]:
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
