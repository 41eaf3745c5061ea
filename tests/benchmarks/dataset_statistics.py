"""Time and peak memory of `copolicy-dataset stats`; constructed_statistics.py has its estimates beside the truth.

    uv run python tests/benchmarks/dataset_statistics.py                    376 episodes of 480 frames at 30 Hz
    uv run python tests/benchmarks/dataset_statistics.py --episodes 2000
    uv run python tests/benchmarks/dataset_statistics.py --root datasets/table

The command runs as a user would start it, on two processors at most, so the time holds the imports too.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from constructed_pairs import carried, row, trajectories, write_folder

from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS

FRAMES, FPS = 480, 30


def main() -> None:
    """Runs the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, help="a data set; by default one is constructed")
    parser.add_argument("--episodes", type=int, default=376)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = arguments.root or write_folder(_carried_over_maps(arguments.episodes), Path(folder) / "table")
        seconds, peak = _run(root, Path(folder) / "statistics.json")
    print(f"copolicy-dataset stats {arguments.root or f'{arguments.episodes} episodes of {FRAMES} frames'}")
    print(f"{seconds:.1f} s, peak {peak / 2**20:.0f} MiB, load before {os.getloadavg()[0]:.1f}")


def _run(root: Path, out: Path) -> tuple[float, int]:
    """Seconds and the largest resident set, bytes."""
    two = sorted(os.sched_getaffinity(0))[:2]
    command = [sys.executable, "-c", "from copolicy.dataset.cli import main; raise SystemExit(main())", "stats"]
    begin = time.perf_counter()
    subprocess.run(
        [*command, str(root), "--out", str(out)],
        check=True,
        stdout=subprocess.DEVNULL,
        preexec_fn=lambda: os.sched_setaffinity(0, two),
    )
    return time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024


def _carried_over_maps(episodes: int):
    """Five pairs on the 36 maps, either side of each obstacle, actions that wander."""
    rng = np.random.default_rng(0)
    maps: tuple[MapConfig, ...] = MAP_SETS["paper36"]
    trips, rows = [], []
    for number in range(episodes):
        config = maps[number % len(maps)]
        word = "".join(rng.choice(["L", "R"], len(config.obstacles)))
        states = carried(word, config, FRAMES, 110 + 8 * rng.standard_normal(), FPS)
        wander = np.cumsum(rng.standard_normal((FRAMES, 4)), axis=0) / 20
        trips.append((states, np.clip(wander - wander.mean(axis=0), -1, 1)))
        pair = "ABCDE"[rng.integers(5)]
        rows.append(row(config, pair_id=pair, map_id=f"m{number % len(maps)}", duration_s=FRAMES / FPS))
    return trajectories(trips, rows, FPS)


if __name__ == "__main__":
    main()
