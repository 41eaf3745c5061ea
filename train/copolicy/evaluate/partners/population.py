"""`partners-sim`: a published population of partners, from a recipe of simulated pairs that no published data set has.

Each proxy is a policy of one simulated pair (S06 to S13). Number of episodes, maps, size of the network and length of
the training differ, so that they differ in skill as well as in style. One half is for choosing settings of a robot; the
other half is only for reporting, and nobody should choose anything by it: a robot that is tuned to its judges says
little about others.
"""

from dataclasses import asdict, dataclass
from typing import Any, TypedDict

NAME = "partners-sim"
DOCUMENT = "partners.json"
"""File of a population's folder with its recipe."""

VERSION = "1"
"""Changes with every change of the recipe."""

CHOOSING, REPORTING = "choosing", "reporting"


class _Half(TypedDict):
    half: str


class PopulationDocument(TypedDict):
    """The keys of `partners.json` that are read."""

    population: str
    version: str
    proxies: dict[str, _Half]
    others: dict[str, str]


@dataclass(frozen=True)
class ProxyRecipe:
    """How a proxy is made.

    Attributes:
        pair: simulated pair of its episodes.
        half: `choosing` or `reporting`.
        episodes: number of episodes.
        maps: map set of its episodes, with four start orientations and displaced starts.
        width: width of its network, a residual MLP with the other settings of the preset `small`.
        n_layers: number of its residual layers.
        steps: length of its training.
        seed: of its episodes and of its training.
        batch_size: frames per training step.
    """

    pair: str
    half: str
    episodes: int
    maps: str
    width: int
    n_layers: int
    steps: int
    seed: int
    batch_size: int = 256


PROXIES: dict[str, ProxyRecipe] = {
    "C1": ProxyRecipe("S06", CHOOSING, 240, "paper36", 384, 3, 6000, 101),
    "C2": ProxyRecipe("S08", CHOOSING, 360, "paper36", 256, 3, 3000, 102),
    "C3": ProxyRecipe("S11", CHOOSING, 180, "varied", 256, 2, 6000, 103),
    "C4": ProxyRecipe("S12", CHOOSING, 480, "varied", 384, 3, 9000, 104),
    "R1": ProxyRecipe("S07", REPORTING, 240, "paper36", 384, 3, 6000, 201),
    "R2": ProxyRecipe("S09", REPORTING, 360, "paper36", 256, 3, 3000, 202),
    "R3": ProxyRecipe("S10", REPORTING, 180, "varied", 256, 2, 6000, 203),
    "R4": ProxyRecipe("S13", REPORTING, 480, "varied", 384, 3, 9000, 204),
}
"""Proxies by name."""

OTHERS: dict[str, str] = {
    "stubborn": CHOOSING,
    "slow": CHOOSING,
    "follower": REPORTING,
    "erratic": REPORTING,
    "human-like": REPORTING,
}
"""Scripted partners, and the half of each; a robot tuned on all scripted kinds before has seen them."""


def half_of(half: str) -> tuple[list[str], list[str]]:
    """Names of the proxies and of the scripted partners of a half, `choosing` or `reporting`."""
    proxies = [name for name, recipe in PROXIES.items() if recipe.half == half]
    return proxies, [name for name, of in OTHERS.items() if of == half]


def described() -> dict[str, Any]:
    """The recipe, as `partners.json` of the population records it."""
    return {
        "population": NAME,
        "version": VERSION,
        "proxies": {name: asdict(recipe) for name, recipe in PROXIES.items()},
        "others": OTHERS,
    }
