"""Time and peak memory of `copolicy-dataset stats`, and its estimates beside the truth of constructed data.

    uv run python tests/benchmarks/dataset_statistics.py                    376 episodes of 480 frames at 30 Hz
    uv run python tests/benchmarks/dataset_statistics.py --episodes 2000
    uv run python tests/benchmarks/dataset_statistics.py --root datasets/table

The command runs as a user would start it, on two processors at most, so the time holds the imports too.
"""

import argparse
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from constructed_pairs import FREE, ONE, carried, row, still, trajectories, write_folder

from copolicy.dataset.map_config import MapConfig
from copolicy.dataset.statistics.compute import compute_statistics
from copolicy.dataset.task import MAP_SETS

FRAMES, FPS = 480, 30


def main() -> None:
    """Runs the command, then the comparison."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, help="a data set; by default one is constructed")
    parser.add_argument("--episodes", type=int, default=376)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        root = arguments.root or write_folder(_carried_over_maps(arguments.episodes), Path(folder) / "table")
        seconds, peak = _run(root, Path(folder) / "statistics.json")
    print(f"copolicy-dataset stats {arguments.root or f'{arguments.episodes} episodes of {FRAMES} frames'}")
    print(f"{seconds:.1f} s, peak {peak / 2**20:.0f} MiB, load before {os.getloadavg()[0]:.1f}\n")
    print(f"{'constructed':<52}{'truth':>8}{'estimate':>10}  95 % interval")
    for what, truth, entry in _comparison():
        low, high = entry["interval"]
        print(f"{what:<52}{truth:>8.3f}{entry['value']:>10.3f}  {low:.3f} to {high:.3f}")


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


def _comparison():
    """What was constructed, its true value, and the entry of the document."""
    rng = np.random.default_rng(1)
    trips, rows = [], []
    for number in range(200):
        pair = number % 8
        side = "L" if rng.random() < 0.7 else "R"
        states = carried(side, ONE, 150, 110 + 6 * rng.standard_normal())
        lead = np.cumsum(rng.standard_normal((160, 2)), axis=0)
        lead = np.clip(0.3 * (lead - np.linspace(lead[0], lead[-1], 160)) / lead.std(axis=0), -1, 1)
        trips.append((states, np.hstack((lead[5:155], lead[3:153]))))  # player 1 is 0.2 s behind
        rows.append(row(pair_id=f"P{pair}", duration_s=10 + 2 * (pair % 2) + rng.standard_normal()))
    statistics = compute_statistics(trajectories(trips, rows))["statistics"]
    yield "route entropy of a 0.7 / 0.3 choice, bits", _entropy(0.7), statistics["routes"]["route_entropy"]
    yield "path modes of two sides", 2, statistics["paths"]["path_modes"]
    yield "share led by player 0, who is 0.2 s ahead", 1, statistics["leadership"]["leadership_share"]
    yield "share of duration by pair, means 10 and 12, sd 1", 0.5, statistics["pairs"]["duration_between_pair_share"]

    trips, rows = [], []
    for number in range(60):
        states = still(200)
        # Pairs in different rows of eight cells: their place tells the pair, one bit.
        states[:, 0] = 12.5 + 25 * rng.integers(0, 8, 200)
        states[:, 1] = 12.5 + 25 * (number % 2)
        states[:, 4] = 40.0
        actions = np.tile([0.6, 0.0, 0.2, 0.0], (200, 1)) * np.where(rng.random((200, 1)) < 0.4, 0, 1)
        actions[:, 2] *= np.where(rng.random(200) < 0.3, -1, 1)
        trips.append((states, actions))
        rows.append(row(FREE, pair_id="AB"[number % 2]))
    statistics = compute_statistics(trajectories(trips, rows))["statistics"]
    visitation, forces = statistics["visitation"], statistics["forces"]
    yield "visitation of 16 cells alike, bits", 4, visitation["visitation_entropy"]
    yield "pairs on different rows, bits", 1, visitation["visitation_divergence_between_pairs"]
    yield "conflict in 3 of 10 frames that tell", 0.3, forces["conflict_fraction"]
    yield "effort 0.6 against 0.2", 0.5, forces["effort_asymmetry"]
    yield "interaction force, mean size", 0.6 * (0.7 * 0.2 + 0.3 * 0.4), forces["interaction_force_mean"]
    yield "idle in 4 of 10 frames", 0.4, statistics["activity"]["idle_player_0"]

    trips = []
    for _ in range(60):
        states = still(200)
        states[:, :2] = rng.uniform((200, 100), (1000, 500), (200, 2))
        signal = (states[:, :1] - 600) / 800
        trips.append((states, signal + 0.2 * rng.standard_normal((200, 4))))
    statistics = compute_statistics(trajectories(trips, [row(FREE)] * 60))["statistics"]
    truth = 0.04 / (0.04 + 1 / 12)
    yield "action variance given the state: noise 0.2 on a line", truth, statistics["actions"]["action_variance_ratio"]
    yield "f95 of white noise at 10 Hz, Hz", 4.75, statistics["smoothness"]["action_f95_player_0"]


def _entropy(share: float) -> float:
    return -share * math.log2(share) - (1 - share) * math.log2(1 - share)


if __name__ == "__main__":
    main()
