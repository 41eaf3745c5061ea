"""The intact beginning of an incomplete or damaged recording: its records up to the first error."""

import struct
import zlib
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, ForeignRecordingError
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.generic_messages import messages_of
from copolicy.dataset.recording.mcap_chunks import LARGEST_CHUNK, MESSAGE_HEAD, chunk_records
from copolicy.dataset.recording.mcap_records import RecordWalk
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, LoopTiming
from copolicy.dataset.recording.reader import recorded_task
from copolicy.dataset.recording.topics import EVENT, LOOP_TIMING, is_channel_of
from copolicy.dataset.recording.verification import CheckSums, channels_text
from copolicy.dataset.task import PairTask

from ..ticker import LoopStatistics, Tick

_LARGEST: dict[int, int] = {
    Opcode.SCHEMA: 1 << 20,
    Opcode.CHANNEL: 1 << 20,
    Opcode.METADATA: 1 << 20,
    Opcode.ATTACHMENT: 16 << 20,
    Opcode.CHUNK: LARGEST_CHUNK,
    Opcode.MESSAGE: 1 << 20,
}
_HEAD = struct.Struct("<BQ")  # opcode, length of the body
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_EPISODE_METADATA = (*episode_records.COLUMNS_AT_START, episode_records.RESULT)
_ENDED = "expected an intact and complete MCAP file, found its end"


@dataclass
class IntactPart:
    """The verified beginning of a recording.

    Attributes:
        path: of the file.
        task: of the recording.
        metadata: its metadata records; those of the start are verified by their digest.
        scenario: of the episode.
        steps: complete steps, each with both actions and the state after it.
        records: number of records in this part, counted as `intact_records` yields them.
        stopped_by: what ended the part; empty where the file is intact.
        between_records: the file ends there, as after a kill, without damage.
        total_reward: over the steps.
        events: all events, also those after the last complete step.
        unverified: descriptions of content without a check sum.
        loop: timing of the loop over the steps; without ticks where time was simulated.
    """

    path: Path
    task: PairTask
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    scenario: Any = None
    steps: int = 0
    records: int = 0
    stopped_by: str = ""
    between_records: bool = False
    total_reward: float = 0.0
    events: list[EpisodeEvent] = field(default_factory=list)
    unverified: tuple[str, ...] = ()
    loop: LoopStatistics = field(init=False)
    recorded: array = field(default_factory=lambda: array("d"), repr=False)

    def __post_init__(self) -> None:
        self.loop = LoopStatistics(self.task.spec.record_hz)

    @property
    def states(self) -> Array:
        """`(steps + 1, n)` by `TaskSpec.state`."""
        recorded = np.asarray(self.recorded).reshape(-1, len(self.task.spec.recorded))
        return self.task.states_of(recorded[: self.steps + 1])


def intact_records(path: Path, task: PairTask, check_sums: CheckSums | None = None) -> Iterator[McapRecord]:
    """Yields schemas, channels, messages, metadata and attachments of a file, with one chunk in memory.

    Args:
        task: of the recording.
        check_sums: is filled with which parts of the file have a check sum.

    Raises:
        FileFormatError: at the first record that fails a check sum or a parser, or at the end of an incomplete file.
    """
    check_sums = CheckSums() if check_sums is None else check_sums
    scenario_file = messages_of(task).scenario_file
    with path.open("rb") as file:
        walk = RecordWalk(path, file, path.stat().st_size)
        for opcode, body in walk.records(_LARGEST):
            try:
                yield from _records_of(opcode, body, scenario_file, check_sums)
            except CopolicyError:
                raise
            except Exception as error:
                # Damaged bytes raise different exceptions in each parser (struct, zstd, UTF-8, ...).
                raise walk.damage(f"damage ({error or type(error).__name__}) in the record that ends") from None
        check_sums.data = walk.data_verified


def read_intact_part(path: Path) -> IntactPart:
    """Reads a file once and determines its verified beginning.

    Raises:
        FileFormatError: the metadata or the map at its start are damaged, or it is not a recording.
        ForeignRecordingError: it is a recording of something else.
    """
    task = recorded_task(path)
    part = IntactPart(path, task)
    checker = _StepChecker(part)
    check_sums = CheckSums()
    try:
        for record in intact_records(path, task, check_sums):
            if isinstance(record, Metadata):
                if record.name in part.metadata and record.name in _EPISODE_METADATA:
                    raise ValueError(f"a second metadata record {record.name!r}")
                part.metadata[record.name] = record.metadata
            elif isinstance(record, Attachment):
                if record.name == messages_of(task).scenario_file:
                    part.scenario = task.scenario_of_json(record.data)
            else:
                checker.add(record)
            part.records += 1
    except FileFormatError as error:
        part.stopped_by = str(error).removeprefix(f"{path}: ")
    except CopolicyError as error:
        part.stopped_by = str(error)
    except Exception as error:
        part.stopped_by = f"expected the next step, found {error or type(error).__name__}"
    part.between_records = not part.stopped_by or part.stopped_by.startswith(_ENDED)
    part.steps = checker.complete
    _check_start(part, checker.foreign)
    part.unverified = check_sums.content_notes()
    checker.fill_part()
    return part


def _records_of(opcode: int, body: bytes, scenario_file: str, check_sums: CheckSums) -> Iterator[McapRecord]:
    if opcode == Opcode.METADATA:
        yield Metadata.read(ReadDataStream(BytesIO(body)))
    elif opcode == Opcode.ATTACHMENT:
        expected = int.from_bytes(body[-4:], "little")
        if expected not in (0, zlib.crc32(body[:-4])):
            raise ValueError("an attachment that fails its check sum")
        attachment = Attachment.read(ReadDataStream(BytesIO(body)))
        if attachment.name == scenario_file:
            check_sums.map = expected != 0
        yield attachment
    elif opcode == Opcode.CHUNK:
        data, verified = chunk_records(body)
        check_sums.chunks += 1
        check_sums.chunks_without += not verified
        yield from _records_in_chunk(data)
    else:
        check_sums.lone_messages += opcode == Opcode.MESSAGE
        yield from _record(opcode, body)


def _records_in_chunk(data: bytes) -> Iterator[McapRecord]:
    position = 0
    while position < len(data):
        opcode, length = _HEAD.unpack_from(data, position)
        begin = position + _HEAD.size
        position = begin + length
        if position > len(data):
            raise ValueError("a record that leaves its chunk")
        yield from _record(opcode, data[begin:position])


def _record(opcode: int, body: bytes) -> Iterator[McapRecord]:
    if opcode == Opcode.MESSAGE:
        channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(body)
        yield Message(channel, log_time, body[MESSAGE_HEAD:], publish_time, sequence)
    elif opcode == Opcode.SCHEMA:
        yield Schema.read(ReadDataStream(BytesIO(body)))
    elif opcode == Opcode.CHANNEL:
        yield Channel.read(ReadDataStream(BytesIO(body)))


class _StepChecker:
    """Counts the steps of a recording and raises ValueError at the first message out of order."""

    def __init__(self, part: IntactPart):
        self._part = part
        self._messages = messages_of(part.task)
        self._schemas: dict[int, str] = {}
        self._declared: set[int] = set()
        self._topics: dict[int, str] = {}  # of our channels; those of other channels are not checked
        self._other_topics: set[str] = set()
        self._next_step = {topic.name: 0 for topic in (self._messages.state, *self._messages.actions)}
        self._sequence = 0
        self._rewards = array("d")
        self._ticks = array("q")  # step, scheduled, start, skipped

    @property
    def complete(self) -> int:
        """Number of steps with a state, both actions and a next state; -1 without any state."""
        states, *actions = self._next_step.values()
        return min(states - 1, *actions)

    @property
    def foreign(self) -> tuple[str, ...]:
        """All topics of a file without any of our topics; empty for a recording of the task."""
        return () if self._topics else tuple(sorted(self._other_topics))

    def add(self, record: McapRecord) -> None:

        if isinstance(record, Schema):
            self._schemas[record.id] = record.name
        elif isinstance(record, Channel):
            self._declared.add(record.id)
            if is_channel_of(record, self._schemas.get(record.schema_id, ""), self._messages.topics):
                self._topics[record.id] = record.topic
            else:
                self._other_topics.add(record.topic)
        elif isinstance(record, Message) and record.channel_id not in self._declared:
            raise ValueError(f"a message of a channel {record.channel_id} that was never declared")
        elif isinstance(record, Message) and record.channel_id in self._topics:
            if record.sequence < self._sequence:
                raise ValueError(f"step {record.sequence} after step {self._sequence}")
            self._sequence = record.sequence
            self._add_message(self._topics[record.channel_id], record)

    def fill_part(self) -> None:
        """Sets the reward and the loop timing of the part over its complete steps."""
        steps = max(0, self._part.steps)
        self._part.total_reward = sum(self._rewards[:steps])
        paused = {event.step for event in self._part.events if event.kind == "pause"}
        for step, scheduled, start, skipped in np.asarray(self._ticks).reshape(-1, 4).tolist():
            if step in paused:
                self._part.loop.pause()
            if step < steps:
                self._part.loop.add(Tick(scheduled, start, skipped))

    def _add_message(self, topic: str, message: Message) -> None:
        if topic == self._messages.state.name:
            step, recorded = self._messages.decode_state(message.data)
            self._advance(topic, step, message.sequence)
            self._part.recorded.extend(recorded)
        elif topic in self._next_step:
            self._advance(topic, self._messages.decode_action(message.data)[0], message.sequence)
        elif topic == self._messages.measures.name:
            self._rewards.append(self._messages.decode_reward(message.data))
        elif topic == LOOP_TIMING.name:
            timing = LoopTiming.FromString(message.data)
            self._ticks.extend((timing.step, timing.scheduled_ns, timing.start_ns, timing.skipped_ticks))
        elif topic == EVENT.name:
            self._part.events.append(EpisodeEvent.FromString(message.data))

    def _advance(self, topic: str, step: int, sequence: int) -> None:
        if not step == sequence == self._next_step[topic]:
            raise ValueError(f"step {step} in place {self._next_step[topic]} of {topic}")
        self._next_step[topic] += 1


def _check_start(part: IntactPart, foreign: tuple[str, ...]) -> None:
    digest = part.metadata.get("dataset_info", {}).get(episode_records.START_DIGEST)
    if digest is None and foreign:
        raise ForeignRecordingError(part.path, "a recording of this task", channels_text(foreign))
    if part.scenario is None or digest is None:
        found = part.stopped_by.rpartition("found ")[2] or "none"
        raise FileFormatError(part.path, "the start of a recording of this task: metadata and map", found)
    if digest != episode_records.start_digest(part.metadata):
        raise FileFormatError(part.path, "the metadata that was written at the start", "another")
