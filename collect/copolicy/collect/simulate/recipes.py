"""Named sets of simulated episodes, so that a data set can be made again from its name."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """All that decides which episodes `simulate` records; see there."""

    episodes: int
    seed: int
    map_set: str = "paper36"
    orientations: bool = False
    start_noise: float = 0.0
    clearance: float | None = None


RECIPES: dict[str, Recipe] = {
    # The size of the paper's training set: five pairs on its 36 configurations, as near to obstacles as people.
    "pairs-sim-376": Recipe(376, seed=0),
    # The same from four start orientations.
    "pairs-sim-376-orientations": Recipe(376, seed=0, orientations=True),
    # The same from beside the starts, and wider around obstacles than people.
    "pairs-sim-376-wide": Recipe(376, seed=0, start_noise=1.0, clearance=2.6),
    # Eight times as many, half of them on random layouts, from beside the starts and in four orientations: what a
    # policy learns most from, where it need not be compared with the paper's.
    "pairs-sim-3000": Recipe(3000, seed=1, map_set="varied", orientations=True, start_noise=1.0),
}
