"""Whether the files are what was written: rows, indices, and the manifest of a release."""

from collections.abc import Iterator

import numpy as np

from ..exceptions import CopolicyError
from ..files.meta_files import CHECK_FILE, MANIFEST_FILE
from ..task_parts import Rule
from ..versions.manifest import Manifest
from .episode_table import EpisodeTable
from .finding import Finding


def _reading(table: EpisodeTable) -> Iterator[Finding]:
    yield from table.damage


def _indices(table: EpisodeTable) -> Iterator[Finding]:
    expected = np.arange(table.frame_count) - np.repeat(table.starts, table.counts)
    first = np.repeat(table.of_framed("dataset_from_index"), table.counts)
    for name, due, message in (
        ("frame_index", expected, "frame_index does not count from 0 in steps of 1"),
        ("index", expected + first, "index does not go on from the episode's dataset_from_index"),
    ):
        wrong = table.count(table.frames[name] != due)
        yield from table.found("rows", wrong > 0, wrong, 0, message)


def _ranges(table: EpisodeTable) -> Iterator[Finding]:
    first, end = table.columns["dataset_from_index"], table.columns["dataset_to_index"]
    message = "dataset_from_index and dataset_to_index span another length"
    yield from table.found("rows", end - first != table.columns["length"], end - first, "length", message)
    gap = np.zeros(len(first), bool)
    gap[1:] = first[1:] != end[:-1]
    yield from table.found("rows", gap, first, "dataset_to_index", "begins where the episode before does not end")


def _manifest(table: EpisodeTable) -> Iterator[Finding]:
    path = table.root / MANIFEST_FILE
    if not path.is_file():
        return
    try:
        # The findings are written by this very command, after every release as well.
        differences = Manifest.read(path).differences(Manifest.from_folder(table.root), without={CHECK_FILE})
    except CopolicyError as error:
        yield Finding("", "check_sum", None, None, "error", str(error).replace(str(path), MANIFEST_FILE))
        return
    for line in differences:
        # A change after a release is how the next one begins; damage looks the same, so that a person must look.
        message = f"{line}; meant: copolicy-dataset release makes the next version, not meant: the file is damaged"
        yield Finding("", "check_sum", None, None, "error", message)


RULES = (
    Rule("reading", "every file is complete; recordings pass all their check sums", _reading, whole=True),
    Rule("indices", "frame_index and index count without gaps", _indices, ("frame_index", "index"),
         ("dataset_from_index",), ("lerobot",), whole=True),
    Rule("ranges", "the episodes' ranges of rows follow on each other", _ranges, (),
         ("dataset_from_index", "dataset_to_index"), ("lerobot",), whole=True),
    Rule("manifest", "sha256 of every file of a release", _manifest, kinds=("lerobot",), whole=True),
)  # fmt: skip
