"""What can be trusted of a recording that broke off or was damaged: its records up to the first doubt."""

import struct
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema

from copolicy.dataset import episode_records
from copolicy.dataset.exceptions import CopolicyError, FileFormatError
from copolicy.dataset.mcap_records import MESSAGE_HEAD, RecordWalk, chunk_data
from copolicy.dataset.messages.copolicy_pb2 import EpisodeEvent, Interaction, LoopTiming, PlayerAction, TableState
from copolicy.dataset.task import MapConfig
from copolicy.dataset.topics import ACTIONS, ENCODING, EVENT, INTERACTION, LOOP_TIMING, TABLE_STATE, TOPICS

from .ticker import LoopStatistics, Tick

_LARGEST: dict[int, int] = {
    Opcode.METADATA: 1 << 20,
    Opcode.ATTACHMENT: 16 << 20,
    Opcode.CHUNK: 64 << 20,
    Opcode.MESSAGE: 1 << 20,
}
_HEAD = struct.Struct("<BQ")  # opcode, length of the body
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK_CRC = slice(24, 28)  # of the body of a chunk
_ENDED = "expected an intact and complete MCAP file, found its end"


@dataclass
class IntactPart:
    """The beginning of a recording that is proven to be what was written.

    Attributes:
        path: of the file.
        metadata: its metadata records; those of the start are proven by their digest.
        map_config: the map.
        steps: complete steps: as many actions of both players, and one state more.
        records: how many records of the file, counted as `intact_records` gives them, are part of it.
        stopped_by: what ended it; empty where the file is whole.
        between_records: the file simply ends there, as after a kill, rather than going on with damage.
        total_reward: over the steps.
        events: what happened, the events after the last complete step among them.
        loop: how well the loop kept its time over the steps; without ticks where time was simulated.
    """

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    map_config: MapConfig | None = None
    steps: int = 0
    records: int = 0
    stopped_by: str = ""
    between_records: bool = False
    total_reward: float = 0.0
    events: list[EpisodeEvent] = field(default_factory=list)
    loop: LoopStatistics = field(default_factory=LoopStatistics)
    positions: array = field(default_factory=lambda: array("d"), repr=False)

    @property
    def table_path(self) -> np.ndarray:
        """`(steps + 1, 2)` the table's centre, px."""
        return np.asarray(self.positions).reshape(-1, 2)[: self.steps + 1]


def intact_records(path: Path) -> Iterator[McapRecord]:
    """Schemas, channels, messages, metadata and attachments from the beginning of a file, one chunk in memory.

    Messages are taken from chunks only, since nothing vouches for one that stands alone in a file without an end.

    Raises:
        FileFormatError: at the first record that fails a check sum or a parser, and where the file breaks off.
    """
    with path.open("rb") as file:
        walk = RecordWalk(path, file, path.stat().st_size)
        for opcode, body in walk.records(_LARGEST):
            try:
                yield from _records_of(opcode, body)
            except CopolicyError:
                raise
            except Exception as error:
                # Damaged bytes fail in as many ways as there are parsers (struct, zstd, UTF-8, ...).
                raise walk.damage(f"damage ({error or type(error).__name__}) in the record that ends") from None


def read_intact_part(path: Path) -> IntactPart:
    """Walks a file once and finds out how far it can be trusted.

    Raises:
        FileFormatError: the metadata or the map at its start are not what was written, or it is no recording.
    """
    part = IntactPart(path)
    count = _StepCount(part)
    try:
        for record in intact_records(path):
            if isinstance(record, Metadata):
                if record.name in part.metadata:
                    raise ValueError(f"a second metadata record {record.name!r}")
                part.metadata[record.name] = record.metadata
            elif isinstance(record, Attachment):
                if record.name == episode_records.MAP_ATTACHMENT:
                    part.map_config = MapConfig.from_json(record.data)
            else:
                count.take(record)
            part.records += 1
    except FileFormatError as error:
        part.stopped_by = str(error).removeprefix(f"{path}: ")
    except CopolicyError as error:
        part.stopped_by = str(error)
    except Exception as error:
        part.stopped_by = f"expected the next step, found {error or type(error).__name__}"
    part.between_records = not part.stopped_by or part.stopped_by.startswith(_ENDED)
    part.steps = count.complete
    _check_start(part)
    count.sum_up()
    return part


def _records_of(opcode: int, body: bytes) -> Iterator[McapRecord]:
    if opcode == Opcode.METADATA:
        yield Metadata.read(ReadDataStream(BytesIO(body)))
    elif opcode == Opcode.ATTACHMENT:
        if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
            raise ValueError("an attachment that fails its check sum")
        yield Attachment.read(ReadDataStream(BytesIO(body)))
    elif opcode == Opcode.CHUNK:
        # A check sum of zero would mean "not computed", which our recorder never writes.
        if not any(body[_CHUNK_CRC]):
            raise ValueError("a chunk without check sum")
        yield from _records_in_chunk(chunk_data(body))
    else:
        raise ValueError("a message outside of any chunk")


def _records_in_chunk(data: bytes) -> Iterator[McapRecord]:
    position = 0
    while position < len(data):
        opcode, length = _HEAD.unpack_from(data, position)
        body = data[position + _HEAD.size : position + _HEAD.size + length]
        position += _HEAD.size + length
        if opcode == Opcode.MESSAGE:
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
            yield Message(channel, log_time, body[MESSAGE_HEAD:], publish_time, sequence)
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(body)))
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(body)))


class _StepCount:
    """Follows the steps of a recording and refuses the first message out of order."""

    def __init__(self, part: IntactPart):
        self._part = part
        self._topics: dict[int, str] = {}
        self._next = {topic.name: 0 for topic in (TABLE_STATE, *ACTIONS)}
        self._sequence = 0
        self._rewards = array("d")
        self._ticks = array("q")  # step, scheduled, start, skipped

    @property
    def complete(self) -> int:
        """Steps with a state, both actions and a state after it; -1 without any state."""
        states, *actions = self._next.values()
        return min(states - 1, *actions)

    def take(self, record: McapRecord) -> None:
        if isinstance(record, Channel):
            self._declare(record)
        elif isinstance(record, Message):
            if record.sequence < self._sequence:
                raise ValueError(f"step {record.sequence} after step {self._sequence}")
            self._sequence = record.sequence
            self._follow(self._topics[record.channel_id], record)

    def sum_up(self) -> None:
        """Tells the part about its complete steps."""
        steps = max(0, self._part.steps)
        self._part.total_reward = sum(self._rewards[:steps])
        paused = {event.step for event in self._part.events if event.kind == "pause"}
        for step, scheduled, start, skipped in np.asarray(self._ticks).reshape(-1, 4).tolist():
            if step in paused:
                self._part.loop.pause()
            if step < steps:
                self._part.loop.add(Tick(scheduled, start, skipped))

    def _declare(self, channel: Channel) -> None:
        known = {topic.name for topic in TOPICS}
        if channel.topic in known and channel.message_encoding != ENCODING:
            raise ValueError(f"{channel.topic} encoded as {channel.message_encoding!r}")
        self._topics[channel.id] = channel.topic

    def _follow(self, topic: str, message: Message) -> None:
        if topic == TABLE_STATE.name:
            state = TableState.FromString(message.data)
            self._advance(topic, state.step, message.sequence)
            self._part.positions.extend((state.x, state.y))
        elif topic in self._next:
            self._advance(topic, PlayerAction.FromString(message.data).step, message.sequence)
        elif topic == INTERACTION.name:
            self._rewards.append(Interaction.FromString(message.data).reward)
        elif topic == LOOP_TIMING.name:
            timing = LoopTiming.FromString(message.data)
            self._ticks.extend((timing.step, timing.scheduled_ns, timing.start_ns, timing.skipped_ticks))
        elif topic == EVENT.name:
            self._part.events.append(EpisodeEvent.FromString(message.data))

    def _advance(self, topic: str, step: int, sequence: int) -> None:
        if not step == sequence == self._next[topic]:
            raise ValueError(f"step {step} in place {self._next[topic]} of {topic}")
        self._next[topic] += 1


def _check_start(part: IntactPart) -> None:
    told = part.metadata.get("dataset_info", {}).get(episode_records.START_DIGEST)
    if part.map_config is None or told is None:
        found = part.stopped_by.rpartition("found ")[2] or "none"
        raise FileFormatError(part.path, "the start of a recording of this task: metadata and map", found)
    if told != episode_records.start_digest(part.metadata):
        raise FileFormatError(part.path, "the metadata that was written at the start", "another")
