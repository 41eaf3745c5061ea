"""Builds an episode from the records of a recording."""

import zlib
from array import array
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from ..arrays import Array
from ..episode import Episode
from ..exceptions import FileFormatError, ForeignRecordingError
from ..settings_text import settings_text
from ..task import PairTask
from . import episode_records
from .generic_messages import messages_of
from .mcap_chunks import MESSAGE_HEAD, chunk_records, walk_chunk
from .mcap_records import RecordWalk
from .messages.copolicy_pb2 import EpisodeEvent
from .topics import EVENT, SCHEMA_PACKAGE, Topic, channel_difference
from .verification import (
    RECOVERY,
    UNVERIFIED,
    CheckSums,
    channels_text,
    require_start_digest,
    require_statistics,
    require_version,
    sole_records,
)


class EpisodeBuilder:
    """Collects states, actions, events, metadata and scenario from the records of a file, and builds the episode.

    Attributes:
        check_sums: which parts of the file have a check sum.
    """

    def __init__(self, path: Path, task: PairTask):
        self.path, self.task, self._task_messages = path, task, messages_of(task)
        self._motion_topics = (self._task_messages.state, *self._task_messages.actions)
        self.check_sums = CheckSums()
        self._declared: dict[tuple[int, int], bytes] = {}
        self._schemas: dict[int, Schema] = {}
        self._handlers: dict[int, Callable[[bytes], None]] = {}
        self._topics: set[str] = set()  # of all channels
        self._differences: dict[str, str] = {}  # for each expected topic, why a channel of that name is unreadable
        self._readable: set[str] = set()  # topics of ours with a channel that can be read
        self._has_copolicy_schema = False  # a channel has a schema of ours, of this version or another
        self._records: dict[str, list[dict[str, str]]] = {}
        self._scenarios: set[bytes] = set()
        self._messages = 0
        self._events: list[EpisodeEvent] = []
        self._steps = {topic.name: array("q") for topic in self._motion_topics}
        self._values = {topic.name: array("d") for topic in self._motion_topics}

    @property
    def events(self) -> tuple[EpisodeEvent, ...]:
        """The events in order of their steps."""
        return tuple(sorted(self._events, key=lambda event: event.step))

    def add_record(self, opcode: int, body: bytes) -> None:
        """Adds one record of the data section.

        Raises:
            UnreadChunkError: a chunk is too large or has an unknown compression.
            Exception: the record is damaged.
        """
        if opcode == Opcode.CHUNK:
            data, verified = chunk_records(body)
            self.check_sums.chunks += 1
            self.check_sums.chunks_without += not verified
            self._messages += walk_chunk(data, self._handlers, self._add_declaration)
        elif opcode == Opcode.MESSAGE:
            if len(body) < MESSAGE_HEAD:
                raise ValueError(f"a message of {len(body)} bytes")
            handler = self._handlers.get(int.from_bytes(body[:2], "little"))
            if handler is not None:
                self.check_sums.lone_messages += 1
                handler(body[MESSAGE_HEAD:])
        elif opcode == Opcode.METADATA:
            record = Metadata.read(ReadDataStream(BytesIO(body)))
            self._records.setdefault(record.name, []).append(record.metadata)
        elif opcode == Opcode.ATTACHMENT:
            self._add_attachment(body)
        else:
            self._add_declaration(opcode, body)

    def _add_attachment(self, body: bytes) -> None:
        expected = int.from_bytes(body[-4:], "little")
        if expected not in (0, zlib.crc32(body[:-4])):
            raise ValueError("an attachment that fails its check sum")
        attachment = Attachment.read(ReadDataStream(BytesIO(body)))
        if attachment.name == self._task_messages.scenario_file:
            self._scenarios.add(attachment.data)
            self.check_sums.map = expected != 0

    def _add_declaration(self, opcode: int, body: bytes) -> None:
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            return
        key = (opcode, int.from_bytes(body[:2], "little"))
        if key in self._declared:
            if self._declared[key] != body:
                raise ValueError(f"two {'schemas' if opcode == Opcode.SCHEMA else 'channels'} of number {key[1]}")
            return
        self._declared[key] = body
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self._schemas[schema.id] = schema
            return
        channel = Channel.read(stream)
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            raise ValueError(f"a channel without its schema of number {channel.schema_id}")
        self._has_copolicy_schema |= schema is not None and schema.name.startswith(SCHEMA_PACKAGE)
        self._topics.add(channel.topic)
        for topic in (*self._motion_topics, EVENT):
            if topic.name == channel.topic:
                difference = channel_difference(channel, schema, topic)
                if difference:
                    # Another project may use a channel of this name in the same file.
                    self._differences[topic.name] = difference
                else:
                    self._readable.add(topic.name)
                    self._handlers[channel.id] = self._handler(topic)

    def _handler(self, topic: Topic) -> Callable[[bytes], None]:
        if topic is EVENT:
            return lambda payload: self._events.append(EpisodeEvent.FromString(payload))
        append_step, extend_values = self._steps[topic.name].append, self._values[topic.name].extend
        is_state = topic is self._task_messages.state
        decode = self._task_messages.decode_state if is_state else self._task_messages.decode_action

        def handle(payload: bytes) -> None:
            step, values = decode(payload)
            append_step(step)
            extend_values(values)

        return handle

    def require_this_task(self, summary_topics: Sequence[str] = ()) -> None:
        """Checks that the file is a recording of this task with a known schema version.

        Args:
            summary_topics: topics in the summary of the file, for the error message.

        Raises:
            ForeignRecordingError: it is not.
        """
        infos = self._records.get("dataset_info", [])
        copolicy_infos = [info for info in infos if episode_records.START_DIGEST in info]
        if not self._has_copolicy_schema and not copolicy_infos:
            topics_text = channels_text((*self._topics, *summary_topics))
            raise ForeignRecordingError(self.path, "a recording of this task", topics_text)
        for info in copolicy_infos or infos:
            require_version(self.path, {"dataset_info": info})

    def episode(self, walk: RecordWalk) -> Episode:
        """Builds the episode after all records have been added.

        Raises:
            FileFormatError: the recording is incomplete.
            InvalidValueError: the metadata or the scenario are invalid.
        """
        path, settings_type = self.path, self.task.settings_type
        records = sole_records(path, self._records, (setting.name for setting in fields(settings_type)))
        for topic in self._steps:
            if topic in self._differences and topic not in self._readable:
                raise FileFormatError(path, "a recording of this task", self._differences[topic])
        task, spec = self.task, self.task.spec
        meta = episode_records.decode(records, spec)
        settings = episode_records.decode_settings(records, task)
        if len(self._scenarios) != 1:
            count_text = "none" if not self._scenarios else f"{len(self._scenarios)} of them"
            raise FileFormatError(path, f"an attachment {self._task_messages.scenario_file!r}", count_text)
        fps = records["dataset_info"].get("fps")
        if fps != str(spec.record_hz):
            raise FileFormatError(path, f"a recording at {spec.record_hz} Hz", f"fps {fps!r}")
        require_statistics(path, walk, self._messages + walk.counts[Opcode.MESSAGE])
        states, actions = self._motion(records[episode_records.RESULT].get("steps"))
        check_sums = self.check_sums
        check_sums.data = walk.data_verified
        if not check_sums.data:
            check_sums.start = require_start_digest(path, records)
        scenario = task.scenario_of_json(*self._scenarios)
        recorded_columns = {"physics": settings_text(settings), **task.columns_of(scenario)}
        meta = replace(meta, source_sha256=walk.sha256, **recorded_columns)
        # The check sums of a recovered file do not verify what had no check sum in its source.
        source_notes = records.get(RECOVERY, {}).get(UNVERIFIED, "")
        notes = (*filter(None, (source_notes,)), *check_sums.notes())
        final_state = states[-1]
        return Episode(states[:-1], actions, final_state, meta, scenario, spec.record_hz, settings, notes, spec.name)

    def _motion(self, expected: str | None) -> tuple[Array, Array]:
        """States `(T + 1, n)` and joint actions `(T, 2 m)`, sorted by step.

        Args:
            expected: number of steps according to the result record.
        """
        spec, (state, *actions) = self.task.spec, self._motion_topics
        count = len(self._steps[state.name]) - 1
        if expected != str(count):
            raise FileFormatError(self.path, f"states of {expected} steps and the final one", f"{count + 1} states")
        values = []
        for topic, length in ((state, count + 1), *((topic, count) for topic in actions)):
            steps = np.asarray(self._steps[topic.name])
            order = np.argsort(steps, kind="stable")
            if not np.array_equal(steps[order], np.arange(length)):
                gap = _first_gap(steps[order], length)
                raise FileFormatError(self.path, f"steps 0 to {length - 1} in {topic.name}", gap)
            width = len(spec.recorded if topic is state else spec.action)
            values.append(np.asarray(self._values[topic.name]).reshape(length, width)[order])
        recorded, joint = values[0], np.hstack(values[1:])
        if not np.isfinite(recorded).all():
            raise FileFormatError(self.path, "finite states", "others")
        low, high = spec.joint_action.bounds
        if not ((low <= joint) & (joint <= high)).all():
            raise FileFormatError(self.path, f"actions in {spec.joint_action.range}", "others")
        return self.task.states_of(recorded), joint


def _first_gap(steps: Array, count: int) -> str:
    if len(steps) != count:
        return f"{len(steps)} messages"
    index = int(np.flatnonzero(steps != np.arange(count))[0])
    return f"step {steps[index]} in place {index}"
