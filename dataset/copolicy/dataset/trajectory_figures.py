"""Figures of trajectories: cell sizes and thresholds, as a task sets them, and the document beside the files."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict

from .arrays import Array

FIGURES_FILE = "figures.json"
"""The document beside the figures of `copolicy-eval figures`, with their numbers."""


class FigureDocument(TypedDict):
    """One figure in the document: its title, names of its files, and the definition of what it shows."""

    title: str
    files: list[str]
    definition: str


class FigureSourceDocument(TypedDict):
    """A source of the figures; the label says how its episodes were made."""

    name: str
    label: str
    episodes: int


class FiguresDocument(TypedDict):
    """What readers need of the document; it has further keys (`train/docs/figures.md`)."""

    task: str
    figures: dict[str, FigureDocument]
    sources: list[FigureSourceDocument]


@dataclass(frozen=True)
class PublishedFigures:
    """How the figure code of a publication drew the same quantities, with its faults, for `--as-published`.

    Attributes:
        source: the code, for titles.
        mirrored_interaction: the interaction measure along the mirrored axis, from states `(T, n)` after each step and
            joint actions `(T, 2 m)`; in the task's unit.
        study_scale: published units per unit of the task's measure, for the episodes of a study.
        demonstration_scale: the same for demonstrations; another number is the fault of unlike units.
        bins: bounds in published units: a magnitude between bounds k and k + 1 adds k, one from the last bound on adds
            their number, one that equals another bound adds nothing.
        colour_limit: largest magnitude on the colour scale of a path, in published units.
        visit_limits: least and largest count on the colour scale of visits.
        visit_exponent: exponent of that scale.
        obstacle_side: side of a drawn obstacle, in the unit of the outline.
    """

    source: str
    mirrored_interaction: Callable[[Array, Array], Array]
    study_scale: float
    demonstration_scale: float
    bins: tuple[float, ...]
    colour_limit: float
    visit_limits: tuple[float, float]
    visit_exponent: float
    obstacle_side: float


@dataclass(frozen=True)
class TrajectoryFigures:
    """The part `studies.figures` of a task.

    Attributes:
        visit_cell: side of the cells of the visitation figure, in the unit of the outline.
        interaction_cell: side of the cells of the interaction map.
        thresholds: magnitudes of the interaction measure above which a frame counts, ascending; none without a map.
        thresholds_source: their source and unit, for the caption.
        published: the figures of a publication; None if there are none.
    """

    visit_cell: float
    interaction_cell: float
    thresholds: tuple[float, ...] = ()
    thresholds_source: str = ""
    published: PublishedFigures | None = None
