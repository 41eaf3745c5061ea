"""Files that are not what a command takes, and damaged ones that are, through every command that takes a path: one line
and exit status 1 or 2.

uv run python tests/benchmarks/foreign_sweep.py --copies 200
"""

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from damaged_files import damage_one, sound
from foreign_files import FOREIGN
from reading_commands import COMMANDS, call
from scripted_agents import scripted_agents

from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.collect.simulate.episode_job import record_episode
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import EpisodeMeta
from copolicy.tasks.table.maps import MAP_SETS

SOUND = {("collect recover", kind) for kind in ("empty folder", "recordings of another project")}
"""Calls that rightly pass: nothing below these folders broke off."""


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


def mutated(folder: Path, copies: int, seed: int) -> Iterator[tuple[str, str, str, str]]:
    """The same for damaged copies of sound files; what passes may be the truth or a number that nothing vouches for."""
    rng = np.random.default_rng(seed)
    recording = folder / "recording.mcap"
    config = MAP_SETS["training"][6]
    record_episode(
        recording, config, scripted_agents(3), EpisodeMeta("truth", "s-1", "S01", "S01-a", "S01-b"),
        WallClockAnchor.simulated(10**18),
    )  # fmt: skip
    for kind, (commands, build) in sound(recording).items():
        whole = build(folder / f"whole {kind}")
        for _ in range(copies):
            with tempfile.TemporaryDirectory(dir=folder) as scratch:
                copy = shutil.copytree(whole, Path(scratch) / "copy")
                damage_one(copy, rng)
                for command in commands:
                    path = copy / "episode_000.mcap" if command == "collect replay" else copy
                    verdict, words = call(*COMMANDS[command](path, Path(scratch)))
                    shutil.rmtree(Path(scratch) / "out", ignore_errors=True)
                    yield command, kind, verdict, words


def main() -> int:
    """Prints the counts; exit status 1 where a call ended in anything but one line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--copies", type=int, default=40, help="damaged copies of each kind (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="print what each call said")
    arguments = parser.parse_args()
    counts: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        calls = chain(foreign(Path(folder)), mutated(Path(folder), arguments.copies, arguments.seed))
        for command, kind, verdict, words in progress(calls, None, "calls"):
            counts.setdefault(command, Counter())[verdict.split()[0]] += 1
            if arguments.show or verdict not in ("refused", "passed"):
                print(f"{command} | {kind} | {verdict} | {words.strip()[:300]}")
    for command, verdicts in counts.items():
        print(f"{command:<22}", ", ".join(f"{verdict}: {count}" for verdict, count in sorted(verdicts.items())))
    return int(any(set(verdicts) - {"refused", "passed"} for verdicts in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
