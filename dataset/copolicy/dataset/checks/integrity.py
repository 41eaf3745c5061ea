"""Rules on the integrity of the files: reading, indices, row ranges, and the manifest of a release."""

from collections.abc import Iterator

import numpy as np

from ..exceptions import CopolicyError
from ..files.meta_files import CHECK_FILE, MANIFEST_FILE
from ..task_parts import Rule
from ..versions.manifest import Manifest
from .episode_data import EpisodeData
from .finding import Finding


def _reading(data: EpisodeData) -> Iterator[Finding]:
    yield from data.damage


def _indices(data: EpisodeData) -> Iterator[Finding]:
    expected = np.arange(data.frame_count) - np.repeat(data.starts, data.counts)
    first = np.repeat(data.framed_column("dataset_from_index"), data.counts)
    for name, target, message in (
        ("frame_index", expected, "frame_index does not count from 0 in steps of 1"),
        ("index", expected + first, "index does not count from the episode's dataset_from_index"),
    ):
        wrong = data.count(data.frames[name] != target)
        yield from data.findings("rows", wrong > 0, wrong, 0, message)


def _ranges(data: EpisodeData) -> Iterator[Finding]:
    first, end = data.columns["dataset_from_index"], data.columns["dataset_to_index"]
    message = "dataset_from_index and dataset_to_index do not span the episode's length"
    yield from data.findings("rows", end - first != data.columns["length"], end - first, "length", message)
    gap = np.zeros(len(first), bool)
    gap[1:] = first[1:] != end[:-1]
    yield from data.findings("rows", gap, first, "dataset_to_index", "does not begin where the previous episode ends")


def _manifest(data: EpisodeData) -> Iterator[Finding]:
    path = data.root / MANIFEST_FILE
    if not path.is_file():
        return
    try:
        # This command writes the check report, also after a release.
        differences = Manifest.read(path).differences(Manifest.from_folder(data.root), without={CHECK_FILE})
    except CopolicyError as error:
        yield Finding("", "check_sum", None, None, "error", str(error).replace(str(path), MANIFEST_FILE))
        return
    for line in differences:
        # An intended change after a release cannot be distinguished from damage here; a person must decide.
        message = f"{line}; if intended, make a new version with copolicy-dataset release, else the file is damaged"
        yield Finding("", "check_sum", None, None, "error", message)


RULES = (
    Rule("reading", "every file is complete; recordings pass all their check sums", _reading, whole=True),
    Rule("indices", "frame_index and index count without gaps", _indices, ("frame_index", "index"),
         ("dataset_from_index",), ("lerobot",), whole=True),
    Rule("ranges", "the episodes' ranges of rows follow on each other", _ranges, (),
         ("dataset_from_index", "dataset_to_index"), ("lerobot",), whole=True),
    Rule("manifest", "sha256 of every file of a release", _manifest, kinds=("lerobot",), whole=True),
)  # fmt: skip
