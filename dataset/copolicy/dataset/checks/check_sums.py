"""Whether the files are what was written: rows, indices, and the manifest of a release."""

import hashlib
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .episode_table import EpisodeTable
from .finding import Finding
from .rule import Rule, each

MANIFEST = Path("meta/manifest.json")
"""Where a release keeps the sha256 of its files."""

_BLOCK = 1 << 20


def _reading(table: EpisodeTable) -> Iterator[Finding]:
    yield from table.damage


def _indices(table: EpisodeTable) -> Iterator[Finding]:
    frames = table.frames["frame_index"]
    expected = np.arange(table.frame_count) - np.repeat(table.starts, table.counts)
    wrong = np.add.reduceat((frames != expected).astype(int), table.starts)
    message = "frame_index does not count from 0 in steps of 1"
    yield from each(table, wrong > 0, "rows", wrong, 0, "error", message, table.framed)
    first = table.of_framed("dataset_from_index")
    wrong = np.add.reduceat((table.frames["index"] != expected + np.repeat(first, table.counts)).astype(int), table.starts)
    message = "index does not go on from the episode's dataset_from_index"
    yield from each(table, wrong > 0, "rows", wrong, 0, "error", message, table.framed)


def _ranges(table: EpisodeTable) -> Iterator[Finding]:
    first, end = table.columns["dataset_from_index"], table.columns["dataset_to_index"]
    differs = end - first != table.columns["length"]
    message = "dataset_from_index and dataset_to_index span another length"
    yield from each(table, differs, "rows", end - first, "length", "error", message)
    gap = np.zeros(len(first), bool)
    gap[1:] = first[1:] != end[:-1]
    message = "begins where the episode before does not end"
    yield from each(table, gap, "rows", first, "dataset_to_index", "error", message)


def _manifest(table: EpisodeTable) -> Iterator[Finding]:
    path = table.root / MANIFEST
    if not path.is_file():
        return
    try:
        files = json.loads(path.read_text())["files"]
        digests = {name: entry["sha256"] if isinstance(entry, dict) else str(entry) for name, entry in files.items()}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        message = f"{MANIFEST.as_posix()} cannot be read: {type(error).__name__} {error}"
        yield Finding("", "check_sum", None, None, "error", message)
        return
    for name, digest in sorted(digests.items()):
        file = table.root / name
        if not file.resolve().is_relative_to(table.root.resolve()):
            yield Finding("", "check_sum", name, None, "error", "the manifest names a file outside the data set")
        elif not file.is_file():
            yield Finding("", "check_sum", None, None, "error", f"{name} is in the manifest but not here")
        elif (found := _sha256(file)) != digest:
            message = f"{name} is not the file that was released; copolicy-dataset release makes the next version"
            yield Finding("", "check_sum", found[:12], str(digest)[:12], "error", message)


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


RULES = (
    Rule("reading", "every file is complete; recordings pass all their check sums", _reading),
    Rule("indices", "frame_index and index count without gaps", _indices, ("frame_index", "index"),
         ("dataset_from_index",), ("lerobot",)),
    Rule("ranges", "the episodes' ranges of rows follow on each other", _ranges, (),
         ("dataset_from_index", "dataset_to_index"), ("lerobot",)),
    Rule("manifest", "sha256 of every file of a release", _manifest, kinds=("lerobot",)),
)  # fmt: skip
