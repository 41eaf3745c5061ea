"""How time and peak memory of conversion, checks and statistics grow with the number of episodes.

    uv run python tests/benchmarks/growth.py --episodes 100 300 1000 3000 10000

The recordings are of simulated pairs. Of many, `--simulate N` records the first N and copies these under new names and
uuids for the rest: as much to read, check, write and count, but no new motion (the check then reports duplicates).

Every command runs as a user would start it, so its figures hold the imports, some 10 s of processor time. Memory is the
sum of the resident sets of a command's processes, sampled. Processor time is what to compare on a shared machine.
"""

import argparse
import contextlib
import io
import os
import shutil
import subprocess
import sys
import tempfile
import time
import uuid
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

from copolicy.collect.simulate.command import simulate
from copolicy.dataset.recording.reader import read_episode, read_metadata

PART = 1000
_CONVERT = "from copolicy.convert.cli import main; raise SystemExit(main())"
_DATASET = "from copolicy.dataset.cli import main; raise SystemExit(main())"
_HASH = (
    "import sys, pathlib; from copolicy.dataset.versions.content import read_content; "
    "print(read_content(pathlib.Path(sys.argv[1])).hash)"
)
_FOOTER = 8 + 1 + 8 + 20  # magic, opcode, length, fields
_DATA_END = 1 + 8 + 4


@dataclass(frozen=True)
class Cost:
    """Of one command."""

    wall_s: float
    cpu_s: float
    peak_mib: float
    output: str


def recordings(folder: Path, episodes: int, simulated: int) -> list[Path]:
    """That many recordings below a folder, made where they are missing."""
    for begin in range(0, simulated, PART):
        part = folder / f"simulated-{begin:06d}"
        count = min(PART, simulated - begin)
        if not part.is_dir():
            partial = folder / f".{part.name}"
            shutil.rmtree(partial, ignore_errors=True)
            with contextlib.redirect_stdout(io.StringIO()):
                simulate(partial, count, seed=begin)
            partial.rename(part)
    files = sorted(folder.glob("simulated-*/*.mcap"))[:simulated]
    copies = folder / "copies"
    copies.mkdir(exist_ok=True)
    for number in range(len(files), episodes):
        target = copies / f"copy_{number:06d}.mcap"
        if not target.exists():
            copy_as_another(files[number % simulated], target, number)
    return [*files, *sorted(copies.glob("*.mcap"))][:episodes]


def copy_as_another(source: Path, target: Path, number: int) -> None:
    """The same recording with another episode_uuid, its check sum of the data section made anew."""
    data = bytearray(source.read_bytes())
    old = read_metadata(source)["episode"]["episode_uuid"]
    new = str(uuid.uuid5(uuid.NAMESPACE_OID, f"{old} {number}"))
    data[:] = data.replace(old.encode(), new.encode())
    footer = len(data) - _FOOTER + 9
    summary = int.from_bytes(data[footer : footer + 8], "little")
    end = summary - _DATA_END
    data[end + 9 : summary] = zlib.crc32(data[:end]).to_bytes(4, "little")
    partial = target.with_suffix(".part")
    partial.write_bytes(data)
    partial.rename(target)


def measured(code: str, *arguments: str) -> Cost:
    """Runs a command and watches its processes."""
    begin = time.perf_counter()
    before = os.times()
    with tempfile.TemporaryFile("w+", encoding="utf-8") as out:
        process = subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=out)
        peak = 0.0
        while process.poll() is None:
            peak = max(peak, resident(process.pid))
            time.sleep(0.1)
        out.seek(0)
        text = out.read()
    if process.returncode not in (0, 1):
        raise SystemExit(f"{arguments}: exit status {process.returncode}")
    after = os.times()
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return Cost(time.perf_counter() - begin, cpu, peak / 2**20, text)


def resident(pid: int) -> float:
    """Bytes of a process and those that it started."""
    with contextlib.suppress(psutil.Error):
        tree = [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
        sizes = []
        for process in tree:
            with contextlib.suppress(psutil.Error):
                sizes.append(process.memory_info().rss)
        return float(sum(sizes))
    return 0.0


def commands(files: list[Path], folder: Path, workers: int, size: int) -> Iterator[tuple[str, Cost]]:
    """What is measured of a number of episodes."""
    source = folder / "recordings"
    source.mkdir(parents=True)
    for number, path in enumerate(files):
        os.link(path, source / f"episode_{number:06d}.mcap")
    flags = ("--repo-id", "local/growth", "--license", "cc0-1.0")
    one, shards = str(folder / "one"), str(folder / "shards")
    yield "convert, in one go", measured(_CONVERT, "mcap", str(source), "--out", one, *flags)
    flags = (*flags, "--shards", shards, "--shard-episodes", str(size), "--workers", str(workers))
    yield "convert, in shards", measured(_CONVERT, "mcap", str(source), "--out", str(folder / "set"), *flags)
    yield "of that, merging", measured(_CONVERT, "mcap", str(source), "--out", str(folder / "again"), *flags)
    shutil.rmtree(folder / "again")
    shutil.rmtree(folder / "shards")
    yield "check", measured(_DATASET, "check", str(folder / "set"), "--json")
    yield "statistics", measured(_DATASET, "stats", str(folder / "set"))
    cost = measured(_HASH, str(folder / "set"))
    same = cost.output == measured(_HASH, one).output
    yield f"content hash ({'the same' if same else 'ANOTHER'} in shards)", cost


def main() -> None:
    """Prints a table for each number of episodes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, nargs="+", default=[100, 300, 1000, 3000, 10000])
    parser.add_argument("--simulate", type=int, metavar="N", help="recordings to simulate (default: all)")
    parser.add_argument("--recordings", type=Path, help="folder to make and keep recordings in (default: a temporary)")
    parser.add_argument("--workers", type=int, default=1, help="shards at a time (default: %(default)s)")
    parser.add_argument("--shard-episodes", type=int, default=500, help="in each (default: %(default)s)")
    arguments = parser.parse_args()
    sizes = sorted(arguments.episodes)
    simulated = min(arguments.simulate or sizes[-1], sizes[-1])
    os.environ["HF_HUB_OFFLINE"] = "1"
    with tempfile.TemporaryDirectory(dir=arguments.recordings) as temporary:
        kept = arguments.recordings or Path(temporary) / "kept"
        kept.mkdir(parents=True, exist_ok=True)
        begin = time.process_time()
        files = recordings(kept, sizes[-1], simulated)
        read_episode(files[-1])  # a copy that does not read would be left out of every figure
        print(f"{simulated} recordings simulated, {len(files) - simulated} copies; {time.process_time() - begin:.0f} s")
        print(f"{'':<44}{'episodes':>9}{'wall s':>9}{'cpu s':>9}{'ms each':>9}{'to linear':>11}{'peak MiB':>10}")
        before: dict[str, tuple[int, Cost]] = {}
        for size in sizes:
            folder = Path(temporary) / f"{size}"
            for name, cost in commands(files[:size], folder, arguments.workers, arguments.shard_episodes):
                ratio = ""
                if name in before:
                    count, last = before[name]
                    ratio = f"{cost.cpu_s / last.cpu_s / (size / count):.2f}"
                before[name] = size, cost
                each = 1000 * cost.cpu_s / size
                line = f"{size:>9}{cost.wall_s:>9.1f}{cost.cpu_s:>9.1f}{each:>9.1f}{ratio:>11}{cost.peak_mib:>10.0f}"
                print(f"{name:<44}{line}", flush=True)
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
