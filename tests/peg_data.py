"""Data sets of the second task, of its simulated players."""

import contextlib
import io
from pathlib import Path

from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert


def record_pegs(folder: Path, episodes: int = 4, seed: int = 1, maps: str = "right") -> Path:
    """Recordings of simulated pairs."""
    arguments = ("--task", "peg", "--maps", maps, "--episodes", episodes, "--seed", seed, "--workers", 1, "--out")
    with contextlib.redirect_stdout(io.StringIO()):
        assert collect(["simulate", *map(str, arguments), str(folder)]) == 0
    return folder


def convert_pegs(recordings: Path, root: Path, *flags: str) -> Path:
    """A data set at 10 Hz of them."""
    arguments = [str(recordings), "--out", str(root), "--repo-id", "lab/peg", "--license", "cc0-1.0", *flags]
    with contextlib.redirect_stdout(io.StringIO()):
        assert convert(["mcap", *arguments]) == 0
    return root
