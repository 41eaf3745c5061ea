"""Named sets of simulated episodes, so that a data set can be reproduced from a name."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Recipe:
    """The arguments of `simulate` that determine its episodes."""

    episodes: int
    seed: int
    map_set: str = "paper36"
    orientations: bool = False
    start_noise: float = 0.0
    clearance: float | None = None


RECIPES: dict[str, Recipe] = {
    # The size of the paper's training set: five pairs on its 36 configurations, with the clearance of people.
    "pairs-sim-376": Recipe(376, seed=0),
    # The same with the obstacles in every order, as the original program records them, for policies that read a list.
    "pairs-sim-376-orders": Recipe(376, seed=0, map_set="paper36-orders"),
    # The same with four start orientations.
    "pairs-sim-376-orientations": Recipe(376, seed=0, orientations=True),
    # The same with displaced starts and a wider clearance than people's.
    "pairs-sim-376-wide": Recipe(376, seed=0, start_noise=1.0, clearance=2.6),
    # Eight times as many, half of them on random layouts, with displaced starts and four orientations: the best data to
    # train on, where no comparison with the paper's is needed.
    "pairs-sim-3000": Recipe(3000, seed=1, map_set="varied", orientations=True, start_noise=1.0),
}
