"""Recovers readable episodes from incomplete recordings, and deletes nothing.

`NAME.mcap.part` is not changed; `NAME.recovered.mcap` beside it is an ordinary recording up to the last step that is
verified as complete. A second run finds that file and does nothing.
"""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, ForeignRecordingError, OutputExistsError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import distinct_files
from copolicy.dataset.files.lock import lock, unlock_on_windows
from copolicy.dataset.recording.reader import read_episode, read_metadata
from copolicy.dataset.recording.verification import RECOVERY

from .episode_file import PART_SUFFIX
from .intact_records import read_intact_part
from .recovered_file import RECOVERED, write_recovered

Status = Literal["recovered", "already_recovered", "empty", "running", "damaged", "foreign"]


@dataclass(frozen=True)
class Recovery:
    """Result of the recovery of one file.

    Attributes:
        source: the incomplete or damaged file; it is never changed.
        status: `recovered`; `already_recovered` by an earlier run; `empty`: it has no complete step; `running`: another
            process is recording it; `damaged`: none of its content can be verified, or it is a damaged finished
            recording; `foreign`: it is a recording of something else, or of a later version.
        output: the recovered episode.
        steps: number of steps of the recovered episode.
        detail: what ended the recording, or what is wrong with the file.
    """

    source: Path
    status: Status
    output: Path | None = None
    steps: int = 0
    detail: str = ""


def recover(folder: Path | str, finished: bool = False, damaged: bool = False) -> list[Recovery]:
    """Recovers every incomplete recording in a folder and its subfolders.

    Args:
        folder: of recordings.
        finished: also read every finished recording, and report the damaged ones.
        damaged: also recover the intact beginning of finished recordings that are damaged.

    Returns:
        One entry for each file that is not an intact, finished recording, sorted by name.

    Raises:
        FileFormatError: no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    parts = distinct_files(folder, f"*.mcap{PART_SUFFIX}")
    recoveries = [_try_recover(part) for part in progress(parts, len(parts), "incomplete")]
    if finished or damaged:
        files = distinct_files(folder, "*.mcap")
        for file in progress(files, len(files), "finished"):
            try:
                read_episode(file)
            except ForeignRecordingError as error:
                recoveries.append(Recovery(file, "foreign", detail=_without_path(error, file)))
            except FileFormatError as error:
                recoveries.append(_try_recover(file) if damaged else Recovery(file, "damaged", detail=str(error)))
    return recoveries


def recover_file(source: Path | str) -> Recovery:
    """Recovers one incomplete or damaged recording.

    The episode ends with the last state before which every step has both actions. It has the metadata of the source,
    the reason `crash_recovered`, the flag `recovered`, and a record `recovery` with the digest of the source and what
    ended it. A source that is complete except for its final name (killed before the renaming) keeps its result and gets
    the flag. The recovered file is read back before it is renamed to its final name.

    Raises:
        FileFormatError: none of the file's content can be verified.
        OutputExistsError: another file has the name of the recovered one.
    """
    source = Path(source)
    name = source.name.removesuffix(PART_SUFFIX).removesuffix(".mcap")
    output = source.with_name(f"{name}.{RECOVERED}.mcap")
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
            return _earlier_recovery(source, output, digest)
        if source.stat().st_size == 0:
            return Recovery(source, "empty", detail="0 bytes")
        part = read_intact_part(source)
        if part.steps < 1:
            if not part.between_records:
                raise FileFormatError(source, "at least one complete step", part.stopped_by.rpartition("found ")[2])
            return Recovery(source, "empty", detail="it ends before the first complete step")
        write_recovered(part, output, digest)
    detail = "; ".join((part.stopped_by or "it was complete except for its name", *part.unverified))
    return Recovery(source, "recovered", output, part.steps, detail)


def summary(folder: Path, recoveries: Iterable[Recovery]) -> dict[str, Any]:
    """The summary of the command: counts, one line a file, and exit status 1 where a file is damaged."""
    recoveries = list(recoveries)
    lines = {str(recovery.source.relative_to(folder)): _line(recovery, folder) for recovery in recoveries}
    counts = {status: sum(item.status == status for item in recoveries) for status in ("recovered", "damaged")}
    return {**counts, "files": lines, "exit_status": int(counts["damaged"] > 0)}


def _line(recovery: Recovery, folder: Path) -> str:
    line = recovery.status.replace("_", " ")
    if recovery.output is not None:
        line += f" as {recovery.output.relative_to(folder)}, {recovery.steps} steps"
    return f"{line}: {recovery.detail}" if recovery.detail else line


def _try_recover(source: Path) -> Recovery:
    try:
        return recover_file(source)
    except ForeignRecordingError as error:
        return Recovery(source, "foreign", detail=_without_path(error, source))
    except CopolicyError as error:
        return Recovery(source, "damaged", detail=str(error))


def _without_path(error: CopolicyError, path: Path) -> str:
    return str(error).removeprefix(f"{path}: ")


def _earlier_recovery(source: Path, output: Path, digest: str) -> Recovery:
    metadata = read_metadata(output)
    if metadata.get(RECOVERY, {}).get("source_sha256") != digest:
        raise OutputExistsError(output)
    return Recovery(source, "already_recovered", output, int(metadata[RECOVERY]["steps"]))
