"""The statistics of constructed pairs: the truth, the estimate, its 95 percent interval, and whether that holds it.

    uv run python tests/benchmarks/constructed_statistics.py
    uv run python tests/benchmarks/constructed_statistics.py --draws 20     how many of 20 intervals hold the truth
    uv run python tests/benchmarks/constructed_statistics.py --json

Nothing here was measured on people or on simulated pairs; the data are drawn so that the answer is known.
"""

import argparse
import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))
from constructed_pairs import FREE, ONE, carried, row, still, trajectories

from copolicy.dataset.statistics.compute import REPLICATES, compute_statistics


class Comparison(NamedTuple):
    """One statistic of constructed data; `interval` is None where it is exact."""

    what: str
    truth: float
    estimate: float
    interval: tuple[float, float] | None

    @property
    def covered(self) -> bool:
        """Whether the interval holds the truth, up to the rounding of the document."""
        low, high = self.interval or (self.estimate, self.estimate)
        return low - 1e-6 <= self.truth <= high + 1e-6


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=1, help="how often the data are drawn; the first is shown")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    draws = [list(compare(arguments.seed + draw)) for draw in range(arguments.draws)]
    covered = [sum(one.covered for one in same) for same in zip(*draws, strict=True)]
    if arguments.json:
        rows = [
            {**one._asdict(), "covered": one.covered, "covered_draws": count, "draws": arguments.draws}
            for one, count in zip(draws[0], covered, strict=True)
        ]
        print(json.dumps(rows, indent=2))
        return
    print(f"{'constructed':<52}{'truth':>8}{'estimate':>10}  {'95 % interval':<18}holds the truth")
    for one, count in zip(draws[0], covered, strict=True):
        low, high = one.interval or (one.estimate, one.estimate)
        times = f" ({count} of {arguments.draws})" if arguments.draws > 1 else ""
        print(
            f"{one.what:<52}{one.truth:>8.3f}{one.estimate:>10.3f}  {f'{low:.3f} to {high:.3f}':<18}"
            f"{'yes' if one.covered else 'NO'}{times}"
        )


def compare(seed: int, replicates: int = REPLICATES) -> Iterator[Comparison]:
    """Every statistic whose truth can be constructed, on data drawn anew for each seed."""
    rng = np.random.default_rng(seed)
    yield from _choices(rng, replicates)
    yield from _forces_and_places(rng, replicates)
    yield from _noise_beside_a_signal(rng, replicates)
    yield from _noise_that_lasts(rng, replicates)


def _choices(rng: np.random.Generator, replicates: int) -> Iterator[Comparison]:
    """Eight pairs that choose a side, one of the players ahead of the other."""
    trips, rows = [], []
    for number in range(200):
        pair = number % 8
        side = "L" if rng.random() < 0.7 else "R"
        states = carried(side, ONE, 150, 110 + 6 * rng.standard_normal())
        lead = np.cumsum(rng.standard_normal((160, 2)), axis=0)
        lead = np.clip(0.3 * (lead - np.linspace(lead[0], lead[-1], 160)) / lead.std(axis=0), -1, 1)
        trips.append((states, np.hstack((lead[5:155], lead[3:153]))))  # player 1 is 0.2 s behind
        rows.append(row(pair_id=f"P{pair}", duration_s=10 + 2 * (pair % 2) + rng.standard_normal()))
    statistics = compute_statistics(trajectories(trips, rows), replicates=replicates)["statistics"]
    yield _of("route entropy of a 0.7 / 0.3 choice, bits", _entropy(0.7), statistics["routes"]["route_entropy"])
    yield _of("path modes of two sides", 2, statistics["paths"]["path_modes"])
    yield _of("share led by player 0, who is 0.2 s ahead", 1, statistics["leadership"]["leadership_share"])
    share = statistics["pairs"]["duration_between_pair_share"]
    yield _of("share of duration by pair, means 10 and 12, sd 1", 0.5, share)


def _forces_and_places(rng: np.random.Generator, replicates: int) -> Iterator[Comparison]:
    """Two pairs in different rows of eight cells, whose place tells the pair: one bit."""
    trips, rows = [], []
    for number in range(60):
        states = still(200)
        states[:, 0] = 12.5 + 25 * rng.integers(0, 8, 200)
        states[:, 1] = 12.5 + 25 * (number % 2)
        states[:, 4] = 40.0
        actions = np.tile([0.6, 0.0, 0.2, 0.0], (200, 1)) * np.where(rng.random((200, 1)) < 0.4, 0, 1)
        actions[:, 2] *= np.where(rng.random(200) < 0.3, -1, 1)
        trips.append((states, actions))
        rows.append(row(FREE, pair_id="AB"[number % 2]))
    statistics = compute_statistics(trajectories(trips, rows), replicates=replicates)["statistics"]
    visitation, forces = statistics["visitation"], statistics["forces"]
    yield _of("visitation of 16 cells alike, bits", 4, visitation["visitation_entropy"])
    yield _of("pairs on different rows, bits", 1, visitation["visitation_divergence_between_pairs"])
    yield _of("conflict in 3 of 10 frames that tell", 0.3, forces["conflict_fraction"])
    yield _of("effort 0.6 against 0.2", 0.5, forces["effort_asymmetry"])
    yield _of("interaction force, mean size", 0.6 * (0.7 * 0.2 + 0.3 * 0.4), forces["interaction_force_mean"])
    yield _of("idle in 4 of 10 frames", 0.4, statistics["activity"]["idle_player_0"])


def _noise_beside_a_signal(rng: np.random.Generator, replicates: int) -> Iterator[Comparison]:
    """Actions that follow a line over the world, with white noise."""
    trips = []
    for _ in range(60):
        states = still(200)
        states[:, :2] = rng.uniform((200, 100), (1000, 500), (200, 2))
        signal = (states[:, :1] - 600) / 800
        trips.append((states, signal + 0.2 * rng.standard_normal((200, 4))))
    statistics = compute_statistics(trajectories(trips, [row(FREE)] * 60), replicates=replicates)["statistics"]
    ratio = statistics["actions"]["action_variance_ratio"]
    yield _of("action variance given the state: noise 0.2 on a line", 0.04 / (0.04 + 1 / 12), ratio)
    yield _of("f95 of white noise at 10 Hz, Hz", 4.75, statistics["smoothness"]["action_f95_player_0"])


def _noise_that_lasts(rng: np.random.Generator, replicates: int) -> Iterator[Comparison]:
    """Parallel ways, actions that follow the distance from their middle, with noise that lasts a second."""
    trips, length, kept = [], 120, math.exp(-1 / 10)
    offsets = np.linspace(-100, 100, 60)
    for offset in offsets:
        states = still(length)
        states[:, 0], states[:, 1] = np.linspace(240, 960, length), 300 + offset
        noise = rng.standard_normal((length, 4))
        for step in range(1, length):
            noise[step] = kept * noise[step - 1] + math.sqrt(1 - kept**2) * noise[step]
        trips.append((states, 0.2 * offset / offsets.std() + 0.2 * noise))
    statistics = compute_statistics(trajectories(trips, [row(FREE)] * 60), replicates=replicates)["statistics"]
    yield _of("the same of parallel ways, noise that lasts 1 s", 0.5, statistics["actions"]["action_variance_ratio"])


def _of(what: str, truth: float, entry: dict[str, Any]) -> Comparison:
    interval = entry["interval"]
    return Comparison(what, truth, entry["value"], None if interval is None else (interval[0], interval[1]))


def _entropy(share: float) -> float:
    return -share * math.log2(share) - (1 - share) * math.log2(1 - share)


if __name__ == "__main__":
    main()
