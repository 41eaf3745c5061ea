"""Turns what a crash left behind into readable episodes, and deletes nothing.

`NAME.mcap.part` stays as it is, byte for byte and by its name; beside it appears `NAME.recovered.mcap`, an ordinary
recording up to the last step that is proven complete. A second run finds that file and does nothing.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, ForeignRecordingError, OutputExistsError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import distinct_files
from copolicy.dataset.files.lock import lock, unlock_on_windows
from copolicy.dataset.recording.log import read_episode, read_metadata
from copolicy.dataset.recording.soundness import RECOVERY

from .episode_file import PART_SUFFIX
from .intact_records import read_intact_part
from .recovered_file import RECOVERED, write_recovered

Status = Literal["recovered", "already_recovered", "empty", "running", "damaged", "foreign"]


@dataclass(frozen=True)
class Recovery:
    """What became of one file.

    Attributes:
        source: the file that broke off or is damaged; it is never changed.
        status: `recovered`, or recovered by an earlier run (`already_recovered`); it broke off before the first
            complete step was on the disk (`empty`); a living process records it (`running`); nothing of it can be
            trusted, or it is a finished recording that is damaged (`damaged`); it is a recording of something else,
            or of a later version (`foreign`).
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
        FileFormatError: no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    parts = distinct_files(folder, f"*.mcap{PART_SUFFIX}")
    found = [_try_recover(part) for part in progress(parts, len(parts), "broken off")]
    if finished or damaged:
        files = distinct_files(folder, "*.mcap")
        for file in progress(files, len(files), "finished"):
            try:
                read_episode(file)
            except ForeignRecordingError as error:
                found.append(Recovery(file, "foreign", detail=_without_path(error, file)))
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
        if not lock(file):
            return Recovery(source, "running", detail="another process is recording it")
        unlock_on_windows(file)
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
        write_recovered(part, output, digest)
    detail = "; ".join((part.stopped_by or "it was complete but for its name", *part.unverified))
    return Recovery(source, "recovered", output, part.steps, detail)


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
    except ForeignRecordingError as error:
        return Recovery(source, "foreign", detail=_without_path(error, source))
    except CopolicyError as error:
        return Recovery(source, "damaged", detail=str(error))


def _without_path(error: CopolicyError, path: Path) -> str:
    return str(error).removeprefix(f"{path}: ")


def _output_of(source: Path) -> Path:
    name = source.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")
    return source.with_name(f"{name}.{RECOVERED}.mcap")


def _earlier(source: Path, output: Path, digest: str) -> Recovery:
    metadata = read_metadata(output)
    if metadata.get(RECOVERY, {}).get("source_sha256") != digest:
        raise OutputExistsError(output)
    return Recovery(source, "already_recovered", output, int(metadata[RECOVERY]["steps"]))
