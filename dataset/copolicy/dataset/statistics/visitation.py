"""Visitation of the scene by the tracked point: entropy, coverage, and divergence between pairs."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from ..arrays import Array
from ..outline import Outline, Shape
from .entropy import entropy, miller_madow
from .estimate import Estimate, Null, left_out
from .resampling import Bootstrap, drawn_within, exchangeable, interval, permuted_within
from .trajectories import Trajectories

COLUMNS = 48
_REPLICATES = 200
_PERMUTATIONS = 199
_NAMES = ("visitation_entropy", "visitation_coverage", "visitation_divergence_between_pairs")


@dataclass(frozen=True)
class Grid:
    """Square cells over a scene, row by row from the top.

    Attributes:
        side: side of a cell, in `unit`.
    """

    side: float
    unit: str
    rows: int

    @classmethod
    def from_outline(cls, outline: Outline) -> "Grid":
        """A grid of `COLUMNS` columns that covers the scene."""
        side = outline.size[0] / COLUMNS
        return cls(side, outline.unit, max(1, math.ceil(outline.size[1] / side - 1e-9)))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return COLUMNS * self.rows

    def __str__(self) -> str:
        return f"a grid of {self.side:g} {self.unit}"

    def counts(self, data: Trajectories) -> csr_matrix:
        """`(E, cells)` number of each episode's frames with the tracked point in each cell."""
        column = np.clip((data.points[:, 0] // self.side).astype(int), 0, COLUMNS - 1)
        row = np.clip((data.points[:, 1] // self.side).astype(int), 0, self.rows - 1)
        ones = np.ones(len(column), dtype=np.float32)
        return csr_matrix((ones, (data.episode, row * COLUMNS + column)), shape=(len(data.rows), self.cells))

    def free(self, obstacles: Sequence[Shape]) -> Array:
        """`(cells,)` whether the centre of each cell is outside all obstacles (convex polygons)."""
        y, x = (np.mgrid[0 : self.rows, 0:COLUMNS] * self.side + self.side / 2).reshape(2, -1)
        free = np.ones(self.cells, dtype=bool)
        for _, corners in obstacles:
            sides = zip(corners, (*corners[1:], corners[0]), strict=True)
            turns = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for (ax, ay), (bx, by) in sides]
            free &= ~(np.all(np.array(turns) > 0, axis=0) | np.all(np.array(turns) < 0, axis=0))
        return free


def visitation_statistics(data: Trajectories, bootstrap: Bootstrap, rng: np.random.Generator) -> dict[str, Estimate]:
    """Entropy and coverage for each obstacle layout, averaged by frames, and divergence between pairs."""
    reason, outline = data.positions_missing, data.task.outline
    if reason or outline is None:
        return left_out(reason, *_NAMES)
    grid = Grid.from_outline(outline)
    counts = grid.counts(data)
    groups = data.groups(with_goal=False)
    weights = np.array([data.lengths[group].sum() for group in groups], dtype=float)
    obstacles = [
        [shape for shape in outline.fixed(data.rows[group[0]].scenario) if shape.role == "obstacle"] for group in groups
    ]
    free = [grid.free(shapes) for shapes in obstacles]
    pooled = [np.asarray(counts[group].sum(axis=0)).ravel() for group in groups]
    bits = np.array([miller_madow(row) for row in pooled])
    coverage = np.array([(row[cells] > 0).mean() for row, cells in zip(pooled, free, strict=True)])
    replicates = bootstrap.weights[:_REPLICATES]
    replicate_bits, replicate_coverage, replicate_weights = (np.zeros((len(replicates), len(groups))) for _ in range(3))
    for index, group in enumerate(groups):
        replicate_counts = np.asarray(replicates[:, group] @ counts[group])
        replicate_weights[:, index] = replicate_counts.sum(axis=1)
        replicate_bits[:, index] = miller_madow(replicate_counts)
        replicate_coverage[:, index] = (replicate_counts[:, free[index]] > 0).mean(axis=1)
    nonempty = replicate_weights.sum(axis=1) > 0
    replicate_weights = replicate_weights[nonempty] / replicate_weights[nonempty].sum(axis=1, keepdims=True)
    per_layout = [
        {
            "obstacles": [np.mean(shape.corners, axis=0) for shape in obstacles[index]],
            "episodes": len(group),
            "entropy_bits": float(bits[index]),
            "coverage": float(coverage[index]),
        }
        for index, group in enumerate(groups)
    ]
    value, mean_coverage = float(np.average(bits, weights=weights)), float(np.average(coverage, weights=weights))
    episodes = len(data.rows)
    averaging = f"{grid}, for each obstacle layout, averaged by frames"
    entropy_definition = (
        f"Entropy (Miller-Madow) of {data.task.words.body} over {averaging}; a uniform distribution has "
        f"{np.log2(grid.cells):.1f} bits."
    )
    coverage_definition = (
        f"Proportion of the cells outside obstacles that {data.task.words.body} visited, on {averaging}. It grows "
        "with the number of episodes; the interval is for as many episodes."
    )
    bounds = interval(value, (replicate_bits[nonempty] * replicate_weights).sum(axis=1), 0.0)
    coverage_bounds = interval(mean_coverage, (replicate_coverage[nonempty] * replicate_weights).sum(axis=1), 0.0, 1.0)
    details, resampled = {"layouts": per_layout}, bootstrap.resampled
    return {
        _NAMES[0]: Estimate(value, "bits", entropy_definition, episodes, bounds, resampled, details=details),
        _NAMES[1]: Estimate(mean_coverage, "1", coverage_definition, episodes, coverage_bounds, resampled),
        _NAMES[2]: _between_pairs(data, grid, counts, groups, rng),
    }


def _between_pairs(data: Trajectories, grid: Grid, counts: csr_matrix, groups, rng) -> Estimate:
    definition = (
        "Generalised Jensen-Shannon divergence between the pairs' visitation (mutual information of cell and pair: "
        f"entropy of all pairs together minus the mean entropy of each, by frames) on {grid}, for each obstacle "
        "layout, averaged by frames; 0 if all pairs have the same distribution. With few episodes it is biased upward: "
        "compare it with its null distribution."
    )
    episodes = len(data.rows)
    exchangeable_episodes = exchangeable(data.pairs, data.strata)
    if len(np.unique(data.pairs)) < 2:
        return Estimate(None, "bits", definition, episodes, note="one pair only")
    frames = float(data.lengths.sum())

    def divergence(pairs: Array, weight: Array) -> float:
        total = 0.0
        for group in groups:
            select = csr_matrix((weight[group], (pairs[group], np.arange(len(group)))))
            by_pair = np.asarray((select @ counts[group]).todense())
            frames_of_pairs = by_pair.sum(axis=1)
            total += frames_of_pairs.sum() * entropy(by_pair.sum(axis=0)) - (frames_of_pairs * entropy(by_pair)).sum()
        return total / max(float((weight * data.lengths).sum()), 1.0)

    value = divergence(data.pairs, np.ones(episodes))
    # Pairs are compared, so the episodes of each pair are resampled, not the pairs.
    replicates = [divergence(data.pairs, drawn_within(data.pairs, rng)) for _ in range(_REPLICATES)]
    bounds = interval(value, np.array(replicates), 0.0)
    if not exchangeable_episodes:
        note = "no configuration has episodes of two pairs: no null distribution"
        return Estimate(value, "bits", definition, episodes, bounds, "episodes of each pair", note=note)
    draws = [divergence(permuted_within(data.pairs, data.strata, rng), np.ones(episodes)) for _ in range(_PERMUTATIONS)]
    null = Null.from_draws("pairs shuffled among the episodes of each configuration", value, np.array(draws))
    details = {"excess_over_null_bits": value - null.mean, "shuffled_episodes": exchangeable_episodes, "frames": frames}
    return Estimate(value, "bits", definition, episodes, bounds, "episodes of each pair", null, details=details)
