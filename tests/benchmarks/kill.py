"""SIGKILL at random moments of a real-time recording: how much of the running episode is gone, and nothing else.

Each run starts `copolicy-collect play --headless` with two scripted players, which records at 30 Hz, episode after
episode, and tells through a pipe each step that it has handed to the recorder and the digest of each file that it has
finished. Then it is killed, the folder recovered, and what was told compared with what is there.

uv run python tests/benchmarks/kill.py --kills 50
"""

import argparse
import hashlib
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from copolicy.collect.play import trial
from copolicy.collect.play.session_run import play
from copolicy.collect.play.settings import PlayerSpec, PlaySettings
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.recover import recover
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.physics import Physics

EPISODE_STEPS = 150


@dataclass(frozen=True)
class Kill:
    """What one kill cost.

    Attributes:
        handed: steps of the running episode that the recorder had been given; 0 between two episodes.
        recovered: steps of it that are there after `recover`.
        finished: episodes that were finished before.
        touched: how many of those are no longer what they were.
        unreadable: recovered files that do not read back.
    """

    handed: int
    recovered: int
    finished: int
    touched: int
    unreadable: int

    @property
    def lost(self) -> int:
        """Steps gone."""
        return self.handed - self.recovered


class ShortEpisodes(PlaySettings):
    """A session whose episodes end early, so that kills also fall on beginnings and ends."""

    @property
    def world_settings(self) -> Physics:
        """With another limit."""
        return replace(super().world_settings, step_limit=EPISODE_STEPS)


class TellingRecorder(EpisodeRecorder):
    """The recorder of the session, which tells what it has been given, a line each."""

    def __enter__(self) -> "TellingRecorder":
        super().__enter__()
        _tell(f"begin {self._path.name}")
        return self

    def step(self, *arguments: Any, **options: Any) -> None:
        super().step(*arguments, **options)
        _tell(f"step {self.steps}")

    def finish(self, *arguments: Any, **options: Any) -> None:
        super().finish(*arguments, **options)
        _tell(f"finished {self._path.name} {hashlib.sha256(self._path.read_bytes()).hexdigest()}")


def record_until_killed(folder: Path) -> None:
    """The child: a session in real time that is never complete."""
    trial.EpisodeRecorder = TellingRecorder
    players = (PlayerSpec.parse("scripted"), PlayerSpec.parse("scripted"))
    play(ShortEpisodes(pair="K01", out=folder, players=players, episodes=1000, headless=True, countdown_s=0.0))


def kill_once(folder: Path, after_s: float) -> Kill:
    """Starts a recording process, kills it some seconds after its first step, and takes stock."""
    folder.mkdir()
    child = subprocess.Popen([sys.executable, __file__, "--record", str(folder)], stdout=subprocess.PIPE)
    assert child.stdout is not None
    with child, child.stdout as told:
        told.readline()
        time.sleep(after_s)
        child.kill()
        lines = [line.decode().split() for line in told]
    if child.returncode != -signal.SIGKILL:
        raise RuntimeError(f"expected a process that records until it is killed, found exit status {child.returncode}")
    return _take_stock(folder, lines)


def study(kills: int, seed: int, folder: Path, shortest_s: float, longest_s: float, at_once: int) -> Iterator[Kill]:
    """Kills at random moments, some processes at once."""
    moments = np.random.default_rng(seed).uniform(shortest_s, longest_s, kills)
    with ThreadPoolExecutor(at_once) as pool:
        yield from pool.map(lambda job: kill_once(folder / f"run_{job[0]}", job[1]), enumerate(moments.tolist()))


def _tell(line: str) -> None:
    os.write(1, f"{line}\n".encode())


def _take_stock(folder: Path, lines: list[list[str]]) -> Kill:
    handed, digests = 0, {}
    for kind, *words in lines:
        if kind == "step":
            handed = int(words[0])
        elif kind == "finished":
            digests[words[0]] = words[1]
            handed = 0
        else:
            handed = 0
    recovered = unreadable = 0
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    recoveries = recover(folder, finished=True)
    for one in recoveries:
        if one.output is None:
            unreadable += one.status == "damaged"
        elif len(read_episode(one.output).actions) != one.steps:
            unreadable += 1
        recovered += one.steps
    session = folder / "K01-01"
    if handed and not recoveries:
        # Killed between the renaming and the line that tells of it.
        recovered = len(read_episode(max(session.glob("*.mcap"))).actions)
    touched = sum(hashlib.sha256((session / name).read_bytes()).hexdigest() != told for name, told in digests.items())
    touched += sum(path.read_bytes() != content for path, content in before.items())
    return Kill(handed, recovered, len(digests), touched, unreadable)


def main() -> int:
    """Prints the loss; exit status 1 where more than a second was lost or anything else was touched."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--shortest", type=float, default=0.2, help="s from the first step to the kill")
    parser.add_argument("--longest", type=float, default=8.0, help="s from the first step to the kill")
    parser.add_argument("--at-once", type=int, default=2, help="recording processes beside each other")
    parser.add_argument("--record", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.record is not None:
        record_until_killed(arguments.record)
    with tempfile.TemporaryDirectory() as folder:
        runs = study(
            arguments.kills,
            arguments.seed,
            Path(folder),
            arguments.shortest,
            arguments.longest,
            arguments.at_once,
        )
        kills = list(progress(runs, arguments.kills, "kills"))
    lost = [kill.lost for kill in kills]
    within = sum(kill.handed > 0 for kill in kills)
    print(f"kills                        {len(kills)}, {within} within an episode")
    for name, steps in (("mean", statistics.mean(lost)), ("median", statistics.median(lost)), ("max", max(lost))):
        print(f"lost of the running one      {name} {steps:.1f} steps, {steps / RECORD_HZ:.2f} s")
    print(f"finished episodes            {sum(kill.finished for kill in kills)}, touched {_sum(kills, 'touched')}")
    print(f"recovered files unreadable   {_sum(kills, 'unreadable')}")
    return int(not within or max(lost) > RECORD_HZ or _sum(kills, "touched") > 0 or _sum(kills, "unreadable") > 0)


def _sum(kills: list[Kill], name: str) -> int:
    return sum(getattr(kill, name) for kill in kills)


if __name__ == "__main__":
    sys.exit(main())
