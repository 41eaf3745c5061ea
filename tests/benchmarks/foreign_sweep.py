"""Files that are not what a command takes, through every command that takes a path: one line and exit status 1 or 2.

uv run python tests/benchmarks/foreign_sweep.py --copies 20
"""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from foreign_files import FOREIGN
from reading_commands import COMMANDS, call

from copolicy.dataset.commandline import progress

SOUND = {
    *((command, kind) for command in ("collect recover",) for kind in (
        "empty folder", "folder of text", "folder of hdf5", "npz of other keys", "npz of other shapes",
        "npz of objects", "npz that is text", "recordings of another project", "lerobot of another task",
        "zarr v2 of another project", "zarr v3 of another project", "zarr without arrays", "zarr of other widths",
        "zarr of zeros", "zarr of numbers alone", "zarr with a broken chunk", "zarr with broken metadata",
        "zarr of an unknown compressor", "pickles of anything", "pickles that open", "empty pickles",
        "folder in place of a pickle", "folder named mcap",
    )),
}  # fmt: skip
"""Calls that rightly pass: nothing below these folders broke off."""


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One of: bits flipped, cut, a run of zeros, a run removed, bytes from elsewhere in the file."""
    copy = bytearray(content)
    kind, begin, length = int(rng.integers(5)), int(rng.integers(len(copy))), int(rng.integers(1, 200))
    if kind == 0:
        for place in rng.integers(len(copy), size=int(rng.integers(1, 9))):
            copy[place] ^= 1 << int(rng.integers(8))
    elif kind == 1:
        del copy[begin:]
    elif kind == 2:
        copy[begin : begin + length] = bytes(len(copy[begin : begin + length]))
    elif kind == 3:
        del copy[begin : begin + length]
    else:
        other = int(rng.integers(len(copy)))
        copy[begin : begin + length] = copy[other : other + length]
    return bytes(copy)


def foreign(folder: Path, names: dict | None = None) -> Iterator[tuple[str, str, str, str]]:
    """Command, kind of file, verdict and words, for every command and kind."""
    for kind, build in FOREIGN.items() if names is None else names.items():
        for command, arguments in COMMANDS.items():
            with tempfile.TemporaryDirectory(dir=folder) as scratch:
                place = Path(scratch) / "place"
                place.mkdir()
                path = build(place)
                verdict, words = call(*arguments(path, Path(scratch)))
                if (place / "ran").exists():
                    verdict = "RAN WHAT THE FILE NAMES"
                if verdict == "passed" and (command, kind) not in SOUND:
                    verdict = "PASSED"
            yield command, kind, verdict, words


def main() -> int:
    """Prints the counts; exit status 1 where a call ended in anything but one line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--show", action="store_true", help="print what each call said")
    arguments = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        total = len(COMMANDS) * len(FOREIGN)
        for command, kind, verdict, words in progress(foreign(Path(folder)), total, "calls"):
            counts[verdict.split()[0]] += 1
            if arguments.show or verdict not in ("refused", "passed"):
                print(f"{command} | {kind} | {verdict} | {words.strip()[:300]}")
    print(", ".join(f"{verdict}: {count}" for verdict, count in sorted(counts.items())))
    return int(bool(set(counts) - {"refused", "passed"}))


if __name__ == "__main__":
    sys.exit(main())
