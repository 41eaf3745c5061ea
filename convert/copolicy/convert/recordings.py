"""Converts folders of recordings, one MCAP file an episode, to a LeRobot v3 data set."""

import functools
import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

from copolicy.dataset.clock import stride
from copolicy.dataset.commandline import progress
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.log import read_episode
from copolicy.dataset.staging import require_new

from .prepare import Conversion, LeftOut, NotPrepared, PreparedEpisode, admit, prepare_from

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
    stride(conversion.fps)
    require_new(root)
    if workers < 1:
        raise InvalidValueError("workers", "at least 1", workers)
    files, unfinished = find_recordings(folders)
    left_out = LeftOut()
    with _prepared(files, conversion, min(workers, len(files))) as results:
        # Imported while other processes read already.
        from .lerobot_writer import write_dataset

        shown = progress(results, len(files), "converting")
        written = write_dataset(
            admit(shown, skip_damaged, left_out), root, repo_id, conversion.fps, conversion.hold,
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
    }


def find_recordings(folders: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """The recordings in `folders`, sorted by path within each, and the names of those that broke off (`.part`).

    Raises:
        FileFormatError: a folder does not exist, or there is no recording in any.
    """
    files: list[Path] = []
    unfinished: list[str] = []
    for folder in folders:
        if folder.is_dir():
            files += sorted(folder.rglob("*.mcap"))
            unfinished += [part.name for part in sorted(folder.rglob("*.mcap.part"))]
        elif folder.is_file():
            files.append(folder)
        else:
            raise FileFormatError(folder, "a folder of recordings", "nothing there")
    if not files:
        raise FileFormatError(", ".join(map(str, folders)), "at least one recording (*.mcap)", "none")
    return files, unfinished


@contextmanager
def _prepared(
    files: list[Path], conversion: Conversion, workers: int
) -> Iterator[Iterator[PreparedEpisode | NotPrepared]]:
    read = functools.partial(_read_recording, conversion)
    if workers == 1:
        yield map(read, files)
        return
    # A forked process would inherit the locks of libraries that have threads.
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    try:
        yield pool.map(read, files, chunksize=_BATCH)
    finally:
        pool.shutdown(cancel_futures=True)


def _read_recording(conversion: Conversion, path: Path) -> PreparedEpisode | NotPrepared:
    return prepare_from(path.name, lambda: read_episode(path), conversion, str(path))
