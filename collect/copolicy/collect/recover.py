"""Turns what a crash left behind into readable episodes, and deletes nothing.

`NAME.mcap.part` stays as it is, byte for byte and by its name; beside it appears `NAME.recovered.mcap`, an ordinary
recording up to the last step that is proven complete. A second run finds that file and does nothing.
"""

import contextlib
import hashlib
import itertools
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import BinaryIO, Literal

from mcap.records import Attachment, Channel, McapRecord, Message, Metadata, Schema
from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from copolicy.dataset import episode_records
from copolicy.dataset.commandline import progress
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, InvalidValueError, OutputExistsError
from copolicy.dataset.log import read_episode, read_metadata
from copolicy.dataset.routes import route_class
from copolicy.dataset.task import RECORD_HZ
from copolicy.dataset.topics import EVENT, SCENE, TABLE_STATE

from .episode_file import PART_SUFFIX, sync_folder
from .episode_messages import event_record
from .file_lock import hold
from .intact_records import IntactPart, intact_records, read_intact_part

RECOVERED = "recovered"
"""Quality flag of a recovered episode, and what its name ends with."""

RECORD = "recovery"
"""The metadata record that says what a recovered file was made from."""

_UNFINISHED = ".unfinished"  # a recovered file in the making; the next run starts it anew

Status = Literal["recovered", "already_recovered", "empty", "running", "damaged"]


@dataclass(frozen=True)
class Recovery:
    """What became of one file.

    Attributes:
        source: the file that broke off or is damaged; it is never changed.
        status: `recovered`, or recovered by an earlier run (`already_recovered`); it broke off before the first
            complete step was on the disk (`empty`); a living process records it (`running`); nothing of it can be
            trusted, or it is a finished recording that is damaged (`damaged`).
        output: the recovered episode.
        steps: of the recovered episode.
        detail: what ended the recording, or what is wrong with the file.
    """

    source: Path
    status: Status
    output: Path | None = None
    steps: int = 0
    detail: str = ""


def recover(folder: Path | str, finished: bool = False, damaged: bool = False) -> list[Recovery]:
    """Recovers every recording in a folder and those below that broke off.

    Args:
        folder: where to look.
        finished: also read every finished recording, and report the damaged ones.
        damaged: also recover the intact beginning of finished recordings that are damaged.

    Returns:
        One entry a file that is not a sound, finished recording, by name.

    Raises:
        InvalidValueError: no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InvalidValueError("folder of recordings", "a folder", str(folder))
    parts = sorted(folder.rglob(f"*.mcap{PART_SUFFIX}"))
    found = [_try_recover(part) for part in progress(parts, len(parts), "broken off")]
    if finished or damaged:
        files = sorted(folder.rglob("*.mcap"))
        for file in progress(files, len(files), "finished"):
            try:
                read_episode(file)
            except FileFormatError as error:
                found.append(_try_recover(file) if damaged else Recovery(file, "damaged", detail=str(error)))
    return found


def recover_file(source: Path | str) -> Recovery:
    """Recovers one recording that broke off or was damaged.

    The episode ends with the last state whose every predecessor has both its actions. It keeps its metadata, is
    marked `crash_recovered` and flagged `recovered`, and a record `recovery` names the digest of the source and
    what ended it. A source that only lacks its final name (a kill between the last byte and the renaming) keeps its
    result beside the flag. The outcome is read back before it gets its name.

    Raises:
        FileFormatError: nothing of the file can be trusted.
        OutputExistsError: another file has the name of the recovered one.
    """
    source = Path(source)
    output = _output_of(source)
    try:
        file = source.open("r+b")
    except OSError as error:
        raise FileFormatError(source, "a readable and writable file", error.strerror or str(error)) from None
    with file:
        if not hold(file):
            return Recovery(source, "running", detail="another process is recording it")
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        if output.exists():
            return _earlier(source, output, digest)
        if source.stat().st_size == 0:
            return Recovery(source, "empty", detail="0 bytes")
        part = read_intact_part(source)
        if part.steps < 1:
            if not part.between_records:
                raise FileFormatError(source, "at least one complete step", part.stopped_by.rpartition("found ")[2])
            return Recovery(source, "empty", detail="it ends before the first complete step")
        _write(part, output, digest)
    return Recovery(source, "recovered", output, part.steps, part.stopped_by or "it was complete but for its name")


def summary(folder: Path, recoveries: Iterable[Recovery]) -> dict:
    """What the command prints: files by status, and exit status 1 where one is damaged."""
    recoveries = list(recoveries)
    lines = {str(one.source.relative_to(folder)): _line(one, folder) for one in recoveries}
    counts = {status: sum(one.status == status for one in recoveries) for status in ("recovered", "damaged")}
    return {**counts, "files": lines, "exit_status": int(counts["damaged"] > 0)}


def _line(recovery: Recovery, folder: Path) -> str:
    words = recovery.status.replace("_", " ")
    if recovery.output is not None:
        words += f" as {recovery.output.relative_to(folder)}, {recovery.steps} steps"
    return f"{words}: {recovery.detail}" if recovery.detail else words


def _try_recover(source: Path) -> Recovery:
    try:
        return recover_file(source)
    except CopolicyError as error:
        return Recovery(source, "damaged", detail=str(error))


def _output_of(source: Path) -> Path:
    name = source.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")
    return source.with_name(f"{name}.{RECOVERED}.mcap")


def _earlier(source: Path, output: Path, digest: str) -> Recovery:
    metadata = read_metadata(output)
    if metadata.get(RECORD, {}).get("source_sha256") != digest:
        raise OutputExistsError(output)
    return Recovery(source, "already_recovered", output, int(metadata[RECORD]["steps"]))


def _write(part: IntactPart, output: Path, digest: str) -> None:
    unfinished = output.with_name(output.name + _UNFINISHED)
    try:
        with unfinished.open("wb") as file:
            _copy(part, file, digest)
            file.flush()
            os.fsync(file.fileno())
        episode = read_episode(unfinished)
        if len(episode.actions) != part.steps:
            raise FileFormatError(unfinished, f"{part.steps} steps", str(len(episode.actions)))
    except BaseException:
        # Ours, and worth nothing: the source has all there is.
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise
    if output.exists():
        raise OutputExistsError(output)
    os.replace(unfinished, output)
    sync_folder(output.parent)


def _copy(part: IntactPart, file: BinaryIO, digest: str) -> None:
    writer = Writer(file, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(library=f"copolicy/{version('lerobot_policy_copolicy')} {LIBRARY_IDENTIFIER}")
    copy = _Copy(writer, part.steps)
    for record in itertools.islice(intact_records(part.path), part.records):
        copy.take(record)
    copy.add_event("recovered", part.stopped_by or "complete but for its name")
    writer.add_metadata(episode_records.RESULT, _result(part))
    writer.add_metadata(
        RECORD,
        {
            "source": part.path.name,
            "source_sha256": digest,
            "source_bytes": str(part.path.stat().st_size),
            "steps": str(part.steps),
            "stopped_by": part.stopped_by,
            "recovered_at": datetime.now(UTC).isoformat(timespec="seconds"),
            "software_version": version("lerobot_policy_copolicy"),
        },
    )
    writer.finish()


class _Copy:
    """Copies what belongs to the complete steps, and the state after them, with times and sequence numbers."""

    def __init__(self, writer: Writer, steps: int):
        self._writer, self._steps = writer, steps
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, int] = {}
        self._topics: dict[int, str] = {}
        self._time_ns = 0  # of the final state

    def take(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self._schemas[record.id] = self._writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel):
            schema = self._schemas[record.schema_id]
            self._channels[record.id] = self._writer.register_channel(
                record.topic, record.message_encoding, schema, record.metadata
            )
            self._topics[record.id] = record.topic
        elif isinstance(record, Attachment):
            self._writer.add_attachment(
                record.create_time, record.log_time, record.name, record.media_type, record.data
            )
        elif isinstance(record, Metadata):
            if record.name != episode_records.RESULT:
                self._writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Message):
            self._take_message(record)

    def add_event(self, kind: str, detail: str) -> None:
        topic, payload = event_record(self._steps, kind, detail)
        for channel, name in self._topics.items():
            if name == topic.name:
                self._add(channel, self._time_ns, payload, self._time_ns, self._steps)

    def _take_message(self, message: Message) -> None:
        topic = self._topics[message.channel_id]
        # Sequence numbers are steps. Of the step after the last complete one only the state counts, and what
        # happened before it was read; its scene shows the forces, which are not recorded as acting any more.
        last = self._steps if topic in (TABLE_STATE.name, EVENT.name, SCENE.name) else self._steps - 1
        if message.sequence > last:
            return
        if topic == TABLE_STATE.name:
            self._time_ns = message.log_time
        self._add(message.channel_id, message.log_time, message.data, message.publish_time, message.sequence)

    def _add(self, channel: int, log_time: int, data: bytes, publish_time: int, sequence: int) -> None:
        self._writer.add_message(self._channels[channel], log_time, data, publish_time, sequence)


def _result(part: IntactPart) -> Mapping[str, str]:
    if not part.stopped_by:
        result = dict(part.metadata[episode_records.RESULT])
        flags = [flag for flag in result["quality_flags"].split(",") if flag]
        return result | {"quality_flags": ",".join([*flags, RECOVERED])}
    assert part.map_config is not None
    meta = replace(
        episode_records.decode(
            {**part.metadata, episode_records.RESULT: episode_records.encode(_NOTHING, episode_records.COLUMNS_AT_END)}
        ),
        termination_reason="crash_recovered",
        duration_s=part.steps / RECORD_HZ,
        route_class=route_class(part.table_path, part.map_config),
        quality_flags=RECOVERED,
    )
    result = episode_records.encode(meta, episode_records.COLUMNS_AT_END)
    return result | {"steps": str(part.steps), "total_reward": repr(part.total_reward), "notes": ""}
