"""Writes what can be trusted of a broken recording as a finished one."""

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

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import FileFormatError, OutputExistsError
from copolicy.dataset.files.staging import about, sync_folder
from copolicy.dataset.interaction import identical, may_be_one_device
from copolicy.dataset.recording import episode_records
from copolicy.dataset.recording.generic_messages import messages_of
from copolicy.dataset.recording.log import read_episode
from copolicy.dataset.recording.soundness import RECOVERY, UNVERIFIED
from copolicy.dataset.recording.topics import EVENT, Record, is_ours
from copolicy.dataset.task import PairTask

from ..session.recording_summaries import OFF_CENTRE, PRACTICE
from .episode_messages import event_record
from .intact_records import IntactPart, intact_records
from .recorder import IDENTICAL_ACTIONS

RECOVERED = "recovered"
"""Quality flag of a recovered episode, and what its name ends with."""

_UNFINISHED = ".unfinished"  # a recovered file in the making; the next run starts it anew


def write_recovered(part: IntactPart, output: Path, source_sha256: str) -> None:
    """Writes the complete steps of a part to `output`, which gets its name only after it was read back.

    Raises:
        FileFormatError: what was written does not read back; nothing is left of it.
        OutputExistsError: another file took the name meanwhile.
    """
    unfinished = output.with_name(output.name + _UNFINISHED)
    try:
        with about(output, unfinished), unfinished.open("wb") as file:
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
        # Ours, and worth nothing: the source has all there is.
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise
    sync_folder(output.parent)


def _write(part: IntactPart, file: BinaryIO, source_sha256: str) -> None:
    software = version("lerobot_policy_copolicy")
    writer = Writer(file, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(library=f"copolicy/{software} {LIBRARY_IDENTIFIER}")
    copy = _Copy(writer, part.task, part.steps)
    for record in itertools.islice(intact_records(part.path, part.task), part.records):
        copy.take(record)
    copy.end(part.stopped_by)
    writer.add_metadata(episode_records.RESULT, _result(part, copy.actions))
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


class _Copy:
    """Copies what belongs to the complete steps and the state after them, with times and sequence numbers."""

    def __init__(self, writer: Writer, task: PairTask, steps: int):
        self._writer, self._task, self._steps = writer, task, steps
        self._messages = messages_of(task)
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._names: dict[int, str] = {}
        self._topics: dict[int, str] = {}
        self._taken: tuple[list[Sequence[float]], list[Sequence[float]]] = ([], [])
        self._final: Sequence[float] = ()
        self._time_ns = 0  # of the final state

    @property
    def actions(self) -> np.ndarray:
        """`(steps, m)` of both players in the complete steps."""
        one = len(self._task.spec.action)
        return np.hstack([np.reshape(np.array(actions, float), (-1, one)) for actions in self._taken])

    def take(self, record: McapRecord) -> None:
        """Copies one record, or passes it by."""
        writer = self._writer
        if isinstance(record, Message):
            self._take_message(record)
        elif isinstance(record, Schema):
            self._schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            self._names[record.id] = record.name
        elif isinstance(record, Channel):
            schema = self._schemas[record.schema_id]
            channel = writer.register_channel(record.topic, record.message_encoding, schema, record.metadata)
            self._channels[record.id] = channel
            if is_ours(record, self._names.get(record.schema_id, ""), self._messages.topics):
                self._topics[record.id] = record.topic
        elif isinstance(record, Attachment):
            writer.add_attachment(record.create_time, record.log_time, record.name, record.media_type, record.data)
        elif isinstance(record, Metadata) and record.name not in (episode_records.RESULT, RECOVERY):
            writer.add_metadata(record.name, record.metadata)

    def end(self, stopped_by: str) -> None:
        """Adds the scene of the final state, in which nobody acts any more, and the event of the recovery."""
        nothing = (0.0,) * len(self._task.spec.joint_action)
        for record in self._messages.scene_writer()(self._time_ns, self._final, nothing):
            self._add_ours(record)
        self._add_ours(event_record(self._steps, RECOVERED, stopped_by))

    def _take_message(self, message: Message) -> None:
        topic, state = self._topics.get(message.channel_id), self._messages.state.name
        # Sequence numbers are steps. Of the step after the last complete one count the state, and the events before
        # it, but not what was chosen in it.
        last = self._steps if topic in (state, EVENT.name) else self._steps - 1
        if topic is not None and message.sequence > last:
            return
        if topic == state and message.sequence == self._steps:
            self._final, self._time_ns = self._messages.decode_state(message.data)[1], message.log_time
        for taken, action_topic in zip(self._taken, self._messages.actions, strict=True):
            if topic == action_topic.name:
                taken.append(self._messages.decode_action(message.data)[1])
        channel = self._channels[message.channel_id]
        self._writer.add_message(channel, message.log_time, message.data, message.publish_time, message.sequence)

    def _add_ours(self, record: Record) -> None:
        topic, payload = record
        for channel, name in self._topics.items():
            if name == topic.name:
                self._writer.add_message(self._channels[channel], self._time_ns, payload, self._time_ns, self._steps)


def _result(part: IntactPart, actions: np.ndarray) -> dict[str, str]:
    recorded = part.metadata.get(episode_records.RESULT)
    if recorded is not None and not part.stopped_by:
        flags = [flag for flag in recorded.get("quality_flags", "").split(",") if flag]
        return recorded | {"quality_flags": ",".join([*flags, RECOVERED])}
    happened = {event.kind: event for event in part.events}
    practice = PRACTICE in happened
    columns = {name: text for record in ("episode", "players") for name, text in part.metadata[record].items()}
    who = (columns["source"], columns["controller_0"], columns["controller_1"])
    flags = {
        PRACTICE: practice,
        "paused": "pause" in happened,
        "slow_loop": part.loop.slow,
        OFF_CENTRE: OFF_CENTRE in happened,
        IDENTICAL_ACTIONS: may_be_one_device(*who) and identical(part.task.spec.full_forces(actions)),
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
    if "outcome" in happened:
        # It was played to its end; the crash came before the verdict on it.
        notes.append(f"ended at step {happened['outcome'].step} with {happened['outcome'].detail}, without a verdict")
    result = episode_records.encode(meta, episode_records.COLUMNS_AT_END)
    return result | {"steps": str(part.steps), "total_reward": repr(part.total_reward), "notes": "; ".join(notes)}
