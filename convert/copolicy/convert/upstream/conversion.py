"""Converts files of the original program to a LeRobot v3 data set: finds out which of its three formats they are."""

import functools
import logging
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

from copolicy.dataset.clock import Hold, stride
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import Episode
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.file_kinds import describe_path
from copolicy.dataset.files.listing import broken_links, distinct_files
from copolicy.dataset.files.staging import require_new
from copolicy.tasks.table.spec import SPEC

from ..lerobot.prepare import Conversion, LeftOut, PreparedEpisode, admit, prepare_from
from .episode import UpstreamOptions
from .processed import read_processed
from .raw import read_raw
from .zarr import OBSERVATIONS, ZARR_HZ, ZarrStore
from .zarr_store import array_metadata_files, is_zipped

FORMATS = {
    "raw": "trajectories/ep_N.pkl",
    "processed": "ep_N/ep_N.npz",
    "zarr": "data/obs, data/action, data/past_action and meta/episode_ends of a Zarr store, a folder or zipped",
}

Reader = tuple[str, Callable[[UpstreamOptions], Episode]]
"""An episode by its name, and what reads it."""


@dataclass(frozen=True)
class UpstreamSource:
    """Episodes of one format."""

    format: str
    readers: list[Reader]


def open_upstream(path: Path) -> UpstreamSource:
    """The episodes at `path`: files in the order of their numbers, a store in its own order.

    Raises:
        FileFormatError: none of the formats, or more than one.
    """
    if not path.is_dir() and not is_zipped(path):
        raise FileFormatError(
            path, "a folder of the original program's files or a zipped Zarr store", describe_path(path)
        )
    files = distinct_files(path, "*") if path.is_dir() else []
    for link in broken_links(path) if path.is_dir() else ():
        if link.suffix not in (".pkl", ".npz"):
            logging.warning("warning: %s: a link that leads nowhere; what it led to is left out", link)
    raw = sorted((file for file in files if file.match("trajectories/*.pkl")), key=_by_number)
    processed = sorted(
        (file for file in files if file.match("*.npz") and file.stem == file.parent.name), key=_by_number
    )
    stores = _stores(path, files)
    found = {name: len(files) for name, files in (("raw", raw), ("processed", processed), ("zarr", stores)) if files}
    if len(found) != 1 or len(stores) > 1:
        layouts = "; ".join(f"{name}: {layout}" for name, layout in FORMATS.items())
        parts = ", ".join(f"{count} {name}" for name, count in found.items()) or describe_path(path)
        if not found and parts.startswith("a Zarr store"):
            parts = f"a Zarr store without an array {OBSERVATIONS}"
        raise FileFormatError(path, f"files of one format ({layouts})", parts)
    if stores:
        store = ZarrStore(stores[0])
        return UpstreamSource("zarr", [(f"episode {i}", functools.partial(store.read, i)) for i in range(len(store))])
    if raw:
        return UpstreamSource("raw", _of_files(read_raw, raw, path))
    return UpstreamSource("processed", _of_files(read_processed, processed, path))


def convert_upstream(
    path: Path,
    root: Path,
    repo_id: str,
    fps: int = 10,
    hold: Hold | None = None,
    options: UpstreamOptions = UpstreamOptions(),  # noqa: B008 - frozen
    license: str = "",
    skip_damaged: bool = False,
) -> dict:
    """Writes the episodes at `path` as a data set at `root`.

    Args:
        hold: `mean` by default; `first` and nothing else for a Zarr store, which holds the first action of three.

    Returns:
        Summary of what was written, left out, and noticed.

    Raises:
        OutputExistsError: there is something at `root`.
        FileFormatError: `path` holds none of the formats, or more than one.
        InvalidValueError: a Zarr store at another rate than 10 Hz or with another hold.
        DamagedEpisodeError: a file is damaged and `skip_damaged` is off; nothing is left behind.
        MissingExtraError: lerobot or zarr is not installed.
    """
    stride(fps, SPEC.record_hz)
    require_new(root)
    source = open_upstream(path)
    if source.format == "zarr":
        if fps != ZARR_HZ:
            raise InvalidValueError("fps", f"{ZARR_HZ}: the store holds every third step only", fps)
        if hold == "mean":
            raise InvalidValueError("hold", "'first': the store holds the first of three actions only", hold)
    hold = hold or ("first" if source.format == "zarr" else "mean")
    # Nobody discarded anything here; what is excluded for its map stays in the data set, flagged.
    conversion = Conversion(fps, hold, license, keep_discarded=True)
    left_out, noticed = LeftOut(), _Noticed()
    results = (prepare_from(name, lambda read=read: read(options), conversion) for name, read in source.readers)

    from ..lerobot.writer import write_dataset

    shown = progress(results, len(source.readers), "converting")
    written = write_dataset(
        noticed.watch(admit(shown, skip_damaged, left_out)), root, repo_id, fps, hold,
        lambda: {
            "converter": "copolicy-convert upstream", "version": version("lerobot_policy_copolicy"),
            "format": source.format, "options": asdict(options), "left_out": left_out.record(),
        },
    )  # fmt: skip
    return {
        "format": source.format,
        **written.summary(),
        "damaged_left_out": left_out.messages,
        "excluded": noticed.excluded,
        "quality_flags": dict(noticed.flags),
        "noticed": noticed.notes,
    }


class _Noticed:
    """What the importers flagged, gathered for the summary while episodes pass by."""

    def __init__(self):
        self.flags: Counter[str] = Counter()
        self.notes: list[str] = []
        self.excluded = 0

    def watch(self, episodes: Iterator[PreparedEpisode]) -> Iterator[PreparedEpisode]:
        for episode in episodes:
            self.flags.update(flag for flag in episode.meta.quality_flags.split(",") if flag)
            self.excluded += episode.meta.discarded
            origin, *rest = episode.notes
            self.notes += [f"{note} ({origin})" for note in rest]
            yield episode


def _stores(path: Path, files: Sequence[Path]) -> list[Path]:
    """Zarr stores, folders and zip files, at a path and below it."""
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
