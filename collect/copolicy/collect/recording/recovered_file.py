"""Writes the intact part of an incomplete or damaged recording as a finished recording."""

import contextlib
import itertools
import os
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from copolicy.dataset.arrays import Array
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.files.staging import named_errors, sync_folder
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.generic_messages import messages_of
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.recording.topics import EVENT, Record, is_channel_of
from copolicy.dataset.recording.verification import RECOVERY, UNVERIFIED
from copolicy.dataset.shared_device import identical_actions, may_be_one_device
from copolicy.dataset.task import PairTask

from ..session.recording_summaries import OFF_CENTRE, PRACTICE
from .episode_messages import event_record
from .intact_records import IntactPart, intact_records
from .recorder import IDENTICAL_ACTIONS

RECOVERED = "recovered"
"""Quality flag of a recovered episode, and suffix of its name."""

_UNFINISHED = ".unfinished"  # suffix of a recovered file that is being written; the next run overwrites it


def write_recovered(part: IntactPart, output: Path, source_sha256: str) -> None:
    """Writes the complete steps of a part; the file is renamed to `output` after it was read back.

    Raises:
        FileFormatError: the written file cannot be read back; it was deleted.
        OutputExistsError: another file has taken the name meanwhile.
    """
    unfinished = output.with_name(output.name + _UNFINISHED)
    try:
        with named_errors(output, unfinished), unfinished.open("wb") as file:
            _write(part, file, source_sha256)
            file.flush()
            os.fsync(file.fileno())
        steps = len(read_episode(unfinished).actions)
        if steps != part.steps:
            raise FileFormatError(part.path, f"{part.steps} steps that can be copied", str(steps))
        if output.exists():
            raise OutputExistsError(output)
        os.replace(unfinished, output)
    except BaseException:
        # The incomplete output has no data that the source lacks.
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise
    sync_folder(output.parent)


def _write(part: IntactPart, file: BinaryIO, source_sha256: str) -> None:
    software = version("lerobot_policy_copolicy")
    writer = Writer(file, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(library=f"copolicy/{software} {LIBRARY_IDENTIFIER}")
    copier = _RecordCopier(writer, part.task, part.steps)
    for record in itertools.islice(intact_records(part.path, part.task), part.records):
        copier.add(record)
    copier.end(part.stopped_by)
    writer.add_metadata(episode_records.RESULT, _result(part, copier.actions))
    recovery = {
        "source": part.path.name,
        "source_sha256": source_sha256,
        "source_bytes": str(part.path.stat().st_size),
        "steps": str(part.steps),
        "stopped_by": part.stopped_by,
        "recovered_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "software_version": software,
    }
    if part.unverified:
        recovery[UNVERIFIED] = "; ".join(part.unverified)
    writer.add_metadata(RECOVERY, recovery)
    writer.finish()


class _RecordCopier:
    """Copies the records of the complete steps and of the state after them, with times and sequence numbers."""

    def __init__(self, writer: Writer, task: PairTask, steps: int):
        self._writer, self._task, self._steps = writer, task, steps
        self._messages = messages_of(task)
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._names: dict[int, str] = {}
        self._topics: dict[int, str] = {}
        self._player_actions: tuple[list[Sequence[float]], list[Sequence[float]]] = ([], [])
        self._final_state: Sequence[float] = ()
        self._time_ns = 0  # of the final state

    @property
    def actions(self) -> Array:
        """`(steps, m)` of both players in the complete steps."""
        size = len(self._task.spec.action)
        return np.hstack([np.reshape(np.array(actions, float), (-1, size)) for actions in self._player_actions])

    def add(self, record: McapRecord) -> None:
        """Copies a record if it belongs to the complete steps."""
        writer = self._writer
        if isinstance(record, Message):
            self._add_message(record)
        elif isinstance(record, Schema):
            self._schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            self._names[record.id] = record.name
        elif isinstance(record, Channel):
            schema = self._schemas[record.schema_id]
            channel = writer.register_channel(record.topic, record.message_encoding, schema, record.metadata)
            self._channels[record.id] = channel
            if is_channel_of(record, self._names.get(record.schema_id, ""), self._messages.topics):
                self._topics[record.id] = record.topic
        elif isinstance(record, Attachment):
            writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        elif isinstance(record, Metadata) and record.name not in (episode_records.RESULT, RECOVERY):
            writer.add_metadata(record.name, record.metadata)

    def end(self, stopped_by: str) -> None:
        """Adds the scene of the final state, with zero actions, and the event of the recovery."""
        zeros = (0.0,) * len(self._task.spec.joint_action)
        for record in self._messages.scene_writer()(self._time_ns, self._final_state, zeros):
            self._write(record)
        self._write(event_record(self._steps, RECOVERED, stopped_by))

    def _add_message(self, message: Message) -> None:
        topic, state = self._topics.get(message.channel_id), self._messages.state.name
        # Sequence numbers are steps. Of the step after the last complete one, the state and the events are copied, but
        # not the actions.
        last = self._steps if topic in (state, EVENT.name) else self._steps - 1
        if topic is not None and message.sequence > last:
            return
        if topic == state and message.sequence == self._steps:
            self._final_state, self._time_ns = self._messages.decode_state(message.data)[1], message.log_time
        for actions, action_topic in zip(self._player_actions, self._messages.actions, strict=True):
            if topic == action_topic.name:
                actions.append(self._messages.decode_action(message.data)[1])
        channel = self._channels[message.channel_id]
        self._writer.add_message(channel, message.log_time, message.data, message.publish_time, message.sequence)

    def _write(self, record: Record) -> None:
        topic, payload = record
        for channel, name in self._topics.items():
            if name == topic.name:
                self._writer.add_message(self._channels[channel], self._time_ns, payload, self._time_ns, self._steps)


def _result(part: IntactPart, actions: Array) -> dict[str, str]:
    recorded = part.metadata.get(episode_records.RESULT)
    if recorded is not None and not part.stopped_by:
        flags = [flag for flag in recorded.get("quality_flags", "").split(",") if flag]
        return recorded | {"quality_flags": ",".join([*flags, RECOVERED])}
    events = {event.kind: event for event in part.events}
    practice = PRACTICE in events
    columns = {name: text for record in ("episode", "players") for name, text in part.metadata[record].items()}
    suspected = may_be_one_device(columns["source"], columns["controller_0"], columns["controller_1"])
    flags = {
        PRACTICE: practice,
        "paused": "pause" in events,
        "slow_loop": part.loop.slow,
        OFF_CENTRE: OFF_CENTRE in events,
        IDENTICAL_ACTIONS: suspected and identical_actions(part.task.spec.full_forces(actions)),
        RECOVERED: True,
    }
    meta = EpisodeMeta(
        "",
        termination_reason="crash_recovered",
        duration_s=part.steps / part.task.spec.record_hz,
        achieved_hz=part.loop.achieved_hz,
        late_ticks=part.loop.late,
        route_class=part.task.strategy(part.scenario, part.states),
        quality_flags=",".join(flag for flag, raised in flags.items() if raised),
        discarded=practice,
    )
    notes = [event.detail for event in part.events if event.kind == "note"]
    if "outcome" in events:
        # The episode ended; the crash came before the operator kept or discarded it.
        notes.append(f"ended at step {events['outcome'].step} with {events['outcome'].detail}, without a verdict")
    result = episode_records.encode(meta, episode_records.COLUMNS_AT_END)
    return result | {"steps": str(part.steps), "total_reward": repr(part.total_reward), "notes": "; ".join(notes)}
