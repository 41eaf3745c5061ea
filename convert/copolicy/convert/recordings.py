"""Converts folders of recordings, one MCAP file per episode, to a LeRobot v3 data set."""

import contextlib
import functools
import logging
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import FileFormatError, ForeignRecordingError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import broken_links, distinct_files, without_duplicates
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.recording.reader import read_episode, recorded_task
from copolicy.dataset.worker_pool import WorkerPool

from .lerobot.prepare import Conversion, PreparedEpisode, SkippedEpisode, SkipReport, admit, read_and_prepare

_BATCH = 8  # files handed to a process at a time


def convert_recordings(
    folders: Sequence[Path | str],
    root: Path | str,
    repo_id: str,
    conversion: Conversion,
    skip_damaged: bool = False,
    workers: int = 1,
) -> dict[str, Any]:
    """Writes the episodes of all `*.mcap` files in `folders` as a data set at `root`, in the order of their paths.

    Args:
        folders: folders, searched recursively, or single files.
        workers: number of reading processes; order and content do not depend on it.

    Returns:
        Summary of the written and skipped episodes.

    Raises:
        OutputExistsError: `root` exists.
        FileFormatError: a folder does not exist or holds no recording.
        DamagedEpisodeError: a file is damaged and `skip_damaged` is off; nothing is written.
        MissingExtraError: lerobot is not installed.
    """
    root = Path(root)
    require_new(root)
    if workers < 1:
        raise InvalidValueError("workers", "at least 1", workers)
    files, unfinished = find_recordings(folders)
    require_rate(conversion, files[0])
    skipped = SkipReport()
    notes: list[str] = []
    with _prepare_all(files, conversion, min(workers, len(files))) as results:
        # Imported while other processes read already.
        from .lerobot.writer import write_dataset

        episodes = collect_notes(admit(progress(results, len(files), "converting"), skip_damaged, skipped), notes)
        written = write_dataset(
            episodes, root, repo_id, conversion.fps, conversion.downsampling,
            lambda: {
                "converter": "copolicy-convert mcap", "version": version("lerobot_policy_copolicy"),
                "files": len(files), "left_out": skipped.record(),
            },
        )  # fmt: skip
    return {
        **written.summary(),
        "damaged_left_out": skipped.messages,
        "discarded_left_out": skipped.discarded,
        "unfinished_recordings": unfinished,
        "not_verified": notes,
    }


def require_rate(conversion: Conversion, first: Path) -> None:
    """Checks that `conversion.fps` divides the rate of the recordings; reads the rate from the first file.

    Raises:
        InvalidValueError: it does not.
    """
    with contextlib.suppress(ForeignRecordingError):  # reported later, with the other unreadable files
        stride(conversion.fps, recorded_task(first).spec.record_hz)


def collect_notes(episodes: Iterable[PreparedEpisode], notes: list[str]) -> Iterator[PreparedEpisode]:
    """Yields the episodes unchanged and appends their notes (parts that could not be verified) to `notes`."""
    for episode in episodes:
        notes += [f"episode {episode.meta.episode_uuid}: {note}" for note in episode.notes]
        yield episode


def find_recordings(folders: Sequence[Path | str]) -> tuple[list[Path], list[str]]:
    """Lists the recordings in `folders`, sorted by path within each, and the names of unfinished ones (`.part`).

    A recording that several links point to is listed once. A broken link named `*.mcap` is listed, so that reading it
    raises an error; any other broken link gives a warning.

    Raises:
        FileFormatError: a folder does not exist or cannot be read, or no folder holds a recording.
    """
    files: list[Path] = []
    unfinished: list[str] = []
    broken: list[Path] = []
    if isinstance(folders, str | Path):
        raise InvalidValueError("folders", "a list of folders", str(folders))
    for folder in map(Path, folders):
        if folder.is_dir():
            files += distinct_files(folder, "*.mcap")
            unfinished += [part.name for part in distinct_files(folder, "*.mcap.part")]
            broken += [link for link in broken_links(folder) if not link.match("*.mcap")]
        elif folder.is_file():
            files.append(folder)
        elif folder.is_symlink():
            raise FileFormatError(folder, "a folder of recordings", "a broken link")
        else:
            raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    for link in broken:
        logging.warning("warning: %s: a broken link; its target is skipped", link)
    files = without_duplicates(files)
    if not files:
        kinds = " and ".join(describe_path(Path(folder)) for folder in folders)
        raise FileFormatError(", ".join(map(str, folders)), "at least one recording (*.mcap)", kinds)
    return files, unfinished


@contextlib.contextmanager
def _prepare_all(
    files: list[Path], conversion: Conversion, workers: int
) -> Iterator[Iterator[PreparedEpisode | SkippedEpisode]]:
    read = functools.partial(_read_recording, conversion)
    if workers == 1:
        yield map(read, files)
        return
    with WorkerPool(workers) as pool:
        yield pool.map(read, files, chunksize=_BATCH)


def _read_recording(conversion: Conversion, path: Path) -> PreparedEpisode | SkippedEpisode:
    return read_and_prepare(path.name, lambda: read_episode(path), conversion, str(path))
