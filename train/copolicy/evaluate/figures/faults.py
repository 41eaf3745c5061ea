"""Faults of the figure code that was released with the paper, as switches."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from copolicy.dataset.exceptions import UnknownNameError


@dataclass(frozen=True)
class Faults:
    """Which faults a figure has; all of them by default.

    Attributes:
        raw_counts: numbers of frames as stored instead of rates, so that long episodes, many episodes and high rates
            look like preference.
        accumulated: the array of the interaction map is not reset: panel k shows the sum of the sources 1 to k.
        own_scales: each panel of the interaction map has its own range of colours.
        unit_demonstrations: the interaction of demonstrations is of unit forces, that of studies of 50 times as large
            ones: demonstrations fall into the zero bin whatever the players did.
        mirrored_axis: the interaction is along the mirror image of the axis between the players.
        unsigned_demonstrations: a path of demonstrations shows magnitudes, those of studies signed values.
        shifted_obstacles: an obstacle's centre is drawn as its corner.
        y_up: the scene is mirrored against the screen.
    """

    raw_counts: bool = True
    accumulated: bool = True
    own_scales: bool = True
    unit_demonstrations: bool = True
    mirrored_axis: bool = True
    unsigned_demonstrations: bool = True
    shifted_obstacles: bool = True
    y_up: bool = True

    @classmethod
    def named(cls, names: Sequence[str]) -> "Faults":
        """Only the named faults, or all of them if there is no name.

        Raises:
            UnknownNameError: no such fault.
        """
        for name in names:
            if name not in SENTENCES:
                raise UnknownNameError("fault", name, SENTENCES)
        return cls(**{field.name: not names or field.name in names for field in fields(cls)})

    def of(self, figure: str) -> list[str]:
        """Names of the faults that a figure has, of those that concern it."""
        return [name for name in CONCERNS[figure] if getattr(self, name)]


SENTENCES = {
    "raw_counts": "numbers of stored frames, not rates",
    "accumulated": "panel k is the sum of the panels 1 to k",
    "own_scales": "one colour range for each panel",
    "unit_demonstrations": "demonstrations in unit forces, studies in 50 times as large ones",
    "mirrored_axis": "force along the mirrored axis",
    "unsigned_demonstrations": "magnitudes for demonstrations, signs for studies",
    "shifted_obstacles": "obstacles shifted by half a side",
    "y_up": "y up",
}
"""What each fault does, for titles."""

CONCERNS = {
    "visitation": ("raw_counts", "shifted_obstacles", "y_up"),
    "force-map": (
        "raw_counts", "accumulated", "own_scales", "unit_demonstrations", "mirrored_axis", "shifted_obstacles", "y_up",
    ),
    "force-path": ("unit_demonstrations", "mirrored_axis", "unsigned_demonstrations"),
}  # fmt: skip
"""The faults of each published figure."""
