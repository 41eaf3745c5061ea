"""Detects which of the original program's three formats a path holds, and converts it to a LeRobot v3 data set."""

import functools
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.clock import Downsampling, stride
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import broken_links, distinct_files
from copolicy.dataset.files.staging import require_new
from copolicy.tasks.table.spec import SPEC

from ..lerobot.prepare import Conversion, PreparedEpisode, SkipReport, admit, read_and_prepare
from .build_episode import UpstreamOptions
from .processed import read_processed
from .raw import read_raw
from .zarr_arrays import array_metadata_files, is_zipped
from .zarr_episodes import OBSERVATIONS, ZARR_HZ, ZarrStore

FORMATS = {
    "raw": "trajectories/ep_N.pkl",
    "processed": "ep_N/ep_N.npz",
    "zarr": "data/obs, data/action, data/past_action and meta/episode_ends of a Zarr store, a folder or zipped",
}

Reader = tuple[str, Callable[[UpstreamOptions], Episode]]
"""Name of an episode, and the function that reads it."""


@dataclass(frozen=True)
class UpstreamSource:
    """Episodes of one format."""

    format: str
    readers: list[Reader]


def open_upstream(path: Path) -> UpstreamSource:
    """Finds the episodes at `path`: files sorted by number, episodes of a store in stored order.

    Raises:
        FileFormatError: none of the formats, or several.
    """
    if not path.is_dir() and not is_zipped(path):
        raise FileFormatError(
            path, "a folder of the original program's files or a zipped Zarr store", describe_path(path)
        )
    files = distinct_files(path, "*") if path.is_dir() else []
    for link in broken_links(path) if path.is_dir() else ():
        if link.suffix not in (".pkl", ".npz"):
            logging.warning("warning: %s: a broken link; its target is skipped", link)
    raw = sorted((file for file in files if file.match("trajectories/*.pkl")), key=_by_number)
    processed = sorted(
        (file for file in files if file.match("*.npz") and file.stem == file.parent.name), key=_by_number
    )
    stores = _stores(path, files)
    counts = {name: len(files) for name, files in (("raw", raw), ("processed", processed), ("zarr", stores)) if files}
    if len(counts) != 1 or len(stores) > 1:
        layouts = "; ".join(f"{name}: {layout}" for name, layout in FORMATS.items())
        contents = ", ".join(f"{count} {name}" for name, count in counts.items()) or describe_path(path)
        if not counts and contents.startswith("a Zarr store"):
            contents = f"a Zarr store without an array {OBSERVATIONS}"
        raise FileFormatError(path, f"files of one format ({layouts})", contents)
    if stores:
        store = ZarrStore(stores[0])
        return UpstreamSource("zarr", [(f"episode {i}", functools.partial(store.read, i)) for i in range(len(store))])
    if raw:
        return UpstreamSource("raw", _of_files(read_raw, raw, path))
    return UpstreamSource("processed", _of_files(read_processed, processed, path))


def convert_upstream(
    path: Path | str,
    root: Path | str,
    repo_id: str,
    fps: int = 10,
    downsampling: Downsampling | None = None,
    options: UpstreamOptions = UpstreamOptions(),  # noqa: B008 - frozen
    license: str = "",
    skip_damaged: bool = False,
) -> dict[str, Any]:
    """Writes the episodes at `path` as a data set at `root`.

    Args:
        downsampling: default `mean`; a Zarr store stores the first action of three steps and allows `first` only.

    Returns:
        Summary of the written and skipped episodes, flags and notes.

    Raises:
        OutputExistsError: `root` exists.
        FileFormatError: `path` holds none of the formats, or several.
        InvalidValueError: a Zarr store with an `fps` other than 10 or a downsampling other than `first`.
        DamagedEpisodeError: a file is damaged and `skip_damaged` is off; nothing is written.
        MissingExtraError: lerobot or zarr is not installed.
    """
    path, root = Path(path), Path(root)
    stride(fps, SPEC.record_hz)
    require_new(root)
    source = open_upstream(path)
    if source.format == "zarr":
        if fps != ZARR_HZ:
            raise InvalidValueError("fps", f"{ZARR_HZ}: the store holds every third step only", fps)
        if downsampling == "mean":
            raise InvalidValueError(
                "downsampling", "'first': the store holds the first of three actions only", downsampling
            )
    downsampling = downsampling or ("first" if source.format == "zarr" else "mean")
    # Episodes excluded for a wrong map stay in the data set, flagged; there are no other discarded ones.
    conversion = Conversion(fps, downsampling, license, keep_discarded=True)
    skipped, collected = SkipReport(), _Collected()
    results = (read_and_prepare(name, lambda read=read: read(options), conversion) for name, read in source.readers)

    from ..lerobot.writer import write_dataset

    episodes = admit(progress(results, len(source.readers), "converting"), skip_damaged, skipped)
    written = write_dataset(
        collected.watch(episodes), root, repo_id, fps, downsampling,
        lambda: {
            "converter": "copolicy-convert upstream", "version": version("lerobot_policy_copolicy"),
            "format": source.format, "options": asdict(options), "left_out": skipped.record(),
        },
    )  # fmt: skip
    return {
        "format": source.format,
        **written.summary(),
        "damaged_left_out": skipped.messages,
        "excluded": collected.excluded,
        "quality_flags": dict(collected.flags),
        "noticed": collected.notes,
    }


class _Collected:
    """Flags and notes of the imported episodes, for the summary."""

    def __init__(self):
        self.flags: Counter[str] = Counter()
        self.notes: list[str] = []
        self.excluded = 0

    def watch(self, episodes: Iterator[PreparedEpisode]) -> Iterator[PreparedEpisode]:
        """Yields the episodes unchanged."""
        for episode in episodes:
            self.flags.update(flag for flag in episode.meta.quality_flags.split(",") if flag)
            self.excluded += episode.meta.discarded
            origin, *notes = episode.notes
            self.notes += [f"{note} ({origin})" for note in notes]
            yield episode


def _stores(path: Path, files: Sequence[Path]) -> list[Path]:
    """Zarr stores (folders and zip files) at a path and below it."""
    if path.is_file():
        return [path]
    arrays = {folder for file in files for folder in file.parents if folder.match(OBSERVATIONS)}
    folders = {
        folder.parents[1]
        for folder in arrays
        if any((folder.parents[1] / name).is_file() for name in array_metadata_files(OBSERVATIONS))
    }
    return [*sorted(folders), *(file for file in files if file.match("*.zarr.zip"))]


def _by_number(file: Path) -> tuple:
    numbers = re.findall(r"\d+", file.stem)
    return (str(file.parents[1]), int(numbers[-1]) if numbers else -1, file.stem)


def _of_files(read: Callable[[Path, UpstreamOptions], Episode], files: list[Path], folder: Path) -> list[Reader]:
    return [(file.relative_to(folder).as_posix(), functools.partial(_read_file, read, file)) for file in files]


def _read_file(read: Callable[[Path, UpstreamOptions], Episode], file: Path, options: UpstreamOptions) -> Episode:
    try:
        return read(file, options)
    except OSError as error:
        raise FileFormatError(file, "a file that can be read", error.strerror or str(error)) from None
