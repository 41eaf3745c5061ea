"""Where the table has been: visitation entropy, coverage, and how differently pairs spread over a map."""

import numpy as np
from scipy.sparse import csr_matrix

from copolicy.tasks.table.map_config import WINDOW

from .entropy import entropy, miller_madow
from .estimate import Estimate, Null
from .resampling import Bootstrap, exchangeable, interval, permuted_within
from .trajectories import Trajectories

CELL_PX = 25
_COLUMNS, _ROWS = WINDOW[0] // CELL_PX, WINDOW[1] // CELL_PX
_REPLICATES = 200
_PERMUTATIONS = 199


def visitation_counts(data: Trajectories) -> csr_matrix:
    """`(E, cells)` frames of each episode with the table's centre in each cell of 25 px, row by row from the top."""
    column = np.clip((data.states[:, 0] // CELL_PX).astype(int), 0, _COLUMNS - 1)
    row = np.clip((data.states[:, 1] // CELL_PX).astype(int), 0, _ROWS - 1)
    cell = row * _COLUMNS + column
    ones = np.ones(len(cell), dtype=np.float32)
    return csr_matrix((ones, (data.episode, cell)), shape=(len(data.rows), _COLUMNS * _ROWS))


def free_cells(squares: tuple[tuple[tuple[float, float], float], ...]) -> np.ndarray:
    """`(cells,)` whether the middle of a cell lies outside every obstacle, given by centre and side."""
    y, x = np.mgrid[0:_ROWS, 0:_COLUMNS] * CELL_PX + CELL_PX / 2
    inside = np.zeros((_ROWS, _COLUMNS), dtype=bool)
    for (centre_x, centre_y), size in squares:
        inside |= np.maximum(np.abs(x - centre_x), np.abs(y - centre_y)) < size / 2
    return ~inside.ravel()


def visitation_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Entropy and coverage per set of obstacles, averaged over them by their frames, and divergence between pairs."""
    counts = visitation_counts(data)
    groups = data.groups(with_goal=False)
    weights = np.array([data.lengths[group].sum() for group in groups], dtype=float)
    free = [free_cells(data.rows[group[0]].map_config.squares) for group in groups]
    pooled = [np.asarray(counts[group].sum(axis=0)).ravel() for group in groups]
    bits = np.array([miller_madow(row) for row in pooled])
    seen = np.array([(row[cells] > 0).mean() for row, cells in zip(pooled, free, strict=True)])
    replicates = bootstrap.weights[:_REPLICATES]
    drawn_bits, drawn_seen, drawn_weight = (np.zeros((len(replicates), len(groups))) for _ in range(3))
    for place, group in enumerate(groups):
        again = np.asarray(replicates[:, group] @ counts[group])
        drawn_weight[:, place] = again.sum(axis=1)
        drawn_bits[:, place] = miller_madow(again)
        drawn_seen[:, place] = (again[:, free[place]] > 0).mean(axis=1)
    kept = drawn_weight.sum(axis=1) > 0
    drawn_weight = drawn_weight[kept] / drawn_weight[kept].sum(axis=1, keepdims=True)
    per_layout = [
        {
            "obstacles": data.rows[group[0]].map_config.obstacles,
            "episodes": len(group),
            "entropy_bits": float(bits[place]),
            "coverage": float(seen[place]),
        }
        for place, group in enumerate(groups)
    ]
    value, covered = float(np.average(bits, weights=weights)), float(np.average(seen, weights=weights))
    episodes = len(data.rows)
    grid = f"a grid of {CELL_PX} px, for each set of obstacles, averaged over them by frames"
    return {
        "visitation_entropy": Estimate(
            value,
            "bits",
            f"Entropy (Miller-Madow) of the table's centre over {grid}; a uniform spread would have "
            f"{np.log2(_COLUMNS * _ROWS):.1f} bits.",
            episodes,
            interval(value, (drawn_bits[kept] * drawn_weight).sum(axis=1), 0.0),
            bootstrap.resampled,
            details={"layouts": per_layout},
        ),
        "visitation_coverage": Estimate(
            covered,
            "1",
            f"Share of the cells outside obstacles that the table's centre has been in, on {grid}. It grows with the "
            "number of episodes; the interval is that of as many episodes.",
            episodes,
            interval(covered, (drawn_seen[kept] * drawn_weight).sum(axis=1), 0.0, 1.0),
            bootstrap.resampled,
        ),
        "visitation_divergence_between_pairs": _between_pairs(data, counts, groups, bootstrap, rng),
    }


def _between_pairs(data: Trajectories, counts: csr_matrix, groups, bootstrap: Bootstrap, rng) -> Estimate:
    definition = (
        "Generalised Jensen-Shannon divergence between the pairs' visitation (what a cell tells of who was there: "
        f"entropy of all together less the mean entropy of each, by frames) on a grid of {CELL_PX} px, for each set "
        "of obstacles, averaged over them by frames; 0 where all pairs spread alike. With few episodes it is far "
        "from 0 by chance: hold it against its null."
    )
    episodes = len(data.rows)
    movable = exchangeable(data.pairs, data.strata)
    if len(np.unique(data.pairs)) < 2:
        return Estimate(None, "bits", definition, episodes, note="one pair only")
    frames = float(data.lengths.sum())

    def divergence(pairs: np.ndarray, weight: np.ndarray) -> float:
        total = 0.0
        for group in groups:
            select = csr_matrix((weight[group], (pairs[group], np.arange(len(group)))))
            by_pair = np.asarray((select @ counts[group]).todense())
            share = by_pair.sum(axis=1)
            total += share.sum() * entropy(by_pair.sum(axis=0)) - (share * entropy(by_pair)).sum()
        return total / max(float((weight * data.lengths).sum()), 1.0)

    value = divergence(data.pairs, np.ones(episodes))
    # Pairs are what is compared, so the episodes of each are drawn anew, not the pairs.
    again = []
    for _ in range(_REPLICATES):
        weight = np.zeros(episodes)
        order = np.argsort(data.pairs, kind="stable")
        sizes = np.bincount(data.pairs)
        begin = np.repeat(np.cumsum(sizes) - sizes, sizes)
        np.add.at(weight, order[begin + (rng.random(episodes) * np.repeat(sizes, sizes)).astype(int)], 1.0)
        again.append(divergence(data.pairs, weight))
    bounds = interval(value, np.array(again), 0.0)
    if not movable:
        note = "no configuration was carried by two pairs: no null"
        return Estimate(value, "bits", definition, episodes, bounds, "episodes of each pair", note=note)
    draws = [divergence(permuted_within(data.pairs, data.strata, rng), np.ones(episodes)) for _ in range(_PERMUTATIONS)]
    null = Null.of("pairs shuffled among the episodes of each configuration", value, np.array(draws))
    details = {"excess_over_null_bits": value - null.mean, "shuffled_episodes": movable, "frames": frames}
    return Estimate(value, "bits", definition, episodes, bounds, "episodes of each pair", null, details=details)
