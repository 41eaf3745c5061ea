"""Converts folders of recordings, one MCAP file an episode, to a LeRobot v3 data set."""

import contextlib
import functools
import logging
from collections.abc import Iterable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.exceptions import FileFormatError, ForeignRecordingError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import broken_links, distinct_files, without_duplicates
from copolicy.dataset.files.staging import require_new
from copolicy.dataset.recording.log import read_episode, recorded_task
from copolicy.dataset.worker_pool import WorkerPool

from .lerobot.prepare import Conversion, LeftOut, NotPrepared, PreparedEpisode, admit, prepare_from

_BATCH = 8  # files handed to a process at a time


def convert_recordings(
    folders: Sequence[Path],
    root: Path,
    repo_id: str,
    conversion: Conversion,
    skip_damaged: bool = False,
    workers: int = 1,
) -> dict:
    """Writes the episodes of all `*.mcap` files in `folders` as a data set at `root`, in the order of their paths.

    Args:
        folders: folders, searched with all that is in them, or single files.
        workers: processes that read; neither order nor content depends on it.

    Returns:
        Summary of what was written and left out.

    Raises:
        OutputExistsError: there is something at `root`.
        FileFormatError: a folder does not exist or holds no recording.
        DamagedEpisodeError: a file is damaged and `skip_damaged` is off; nothing is left behind.
        MissingExtraError: lerobot is not installed.
    """
    require_new(root)
    if workers < 1:
        raise InvalidValueError("workers", "at least 1", workers)
    files, unfinished = find_recordings(folders)
    require_rate(conversion, files[0])
    left_out = LeftOut()
    notes: list[str] = []
    with _prepared(files, conversion, min(workers, len(files))) as results:
        # Imported while other processes read already.
        from .lerobot.writer import write_dataset

        shown = progress(results, len(files), "converting")
        written = write_dataset(
            noted(admit(shown, skip_damaged, left_out), notes), root, repo_id, conversion.fps, conversion.hold,
            lambda: {
                "converter": "copolicy-convert mcap", "version": version("lerobot_policy_copolicy"),
                "files": len(files), "left_out": left_out.record(),
            },
        )  # fmt: skip
    return {
        **written.summary(),
        "damaged_left_out": left_out.messages,
        "discarded_left_out": left_out.discarded,
        "unfinished_recordings": unfinished,
        "not_verified": notes,
    }


def require_rate(conversion: Conversion, first: Path) -> None:
    """Checks that the rate asked for divides that of the recordings, of which the first is looked at.

    Raises:
        InvalidValueError: it does not.
    """
    with contextlib.suppress(ForeignRecordingError):  # said with the other files that cannot be read
        stride(conversion.fps, recorded_task(first).spec.record_hz)


def noted(episodes: Iterable[PreparedEpisode], notes: list[str]) -> Iterator[PreparedEpisode]:
    """The episodes as they pass by; what could not be verified of them is added to `notes`."""
    for episode in episodes:
        notes += [f"episode {episode.meta.episode_uuid}: {note}" for note in episode.notes]
        yield episode


def find_recordings(folders: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """The recordings in `folders`, sorted by path within each, and the names of those that broke off (`.part`).

    A recording counts once, whatever links lead to it. A link that leads nowhere is among the recordings where it has
    the name of one, so that reading it says so; of any other there is a warning.

    Raises:
        FileFormatError: a folder does not exist or cannot be read, or there is no recording in any.
    """
    files: list[Path] = []
    unfinished: list[str] = []
    lost: list[Path] = []
    for folder in folders:
        if folder.is_dir():
            files += distinct_files(folder, "*.mcap")
            unfinished += [part.name for part in distinct_files(folder, "*.mcap.part")]
            lost += [link for link in broken_links(folder) if not link.match("*.mcap")]
        elif folder.is_file():
            files.append(folder)
        elif folder.is_symlink():
            raise FileFormatError(folder, "a folder of recordings", "a link that leads nowhere")
        else:
            raise FileFormatError(folder, "a folder of recordings", describe_path(folder))
    for link in lost:
        logging.warning("warning: %s: a link that leads nowhere; what it led to is left out", link)
    files = without_duplicates(files)
    if not files:
        kinds = " and ".join(describe_path(folder) for folder in folders)
        raise FileFormatError(", ".join(map(str, folders)), "at least one recording (*.mcap)", kinds)
    return files, unfinished


@contextlib.contextmanager
def _prepared(
    files: list[Path], conversion: Conversion, workers: int
) -> Iterator[Iterator[PreparedEpisode | NotPrepared]]:
    read = functools.partial(_read_recording, conversion)
    if workers == 1:
        yield map(read, files)
        return
    with WorkerPool(workers) as pool:
        yield pool.map(read, files, chunksize=_BATCH)


def _read_recording(conversion: Conversion, path: Path) -> PreparedEpisode | NotPrepared:
    return prepare_from(path.name, lambda: read_episode(path), conversion, str(path))
