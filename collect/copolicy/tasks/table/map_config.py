"""One map: where an episode starts, where it should end, and what stands between."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass

from copolicy.dataset.exceptions import InvalidValueError

WINDOW = (1200, 600)
"""Width and height of the world, px."""

MAX_OBSTACLES = 3
"""Slots for obstacles in an observation."""

_CANONICAL = json.JSONEncoder(sort_keys=True)


@dataclass(frozen=True)
class MapConfig:
    """Where an episode starts, where it should end, and what stands between.

    Attributes:
        start: pose of the table's centre at rest, (x, y, theta) in px and rad.
        goal: centre of the goal square, px.
        obstacles: centres of up to three solid squares, px, in the order of the observation.
        obstacle_size: side of the squares, px (50 in the training family, 45 in the paper's evaluation).
    """

    start: tuple[float, float, float]
    goal: tuple[float, float]
    obstacles: tuple[tuple[float, float], ...] = ()
    obstacle_size: int = 50

    def __post_init__(self):
        object.__setattr__(self, "start", tuple(float(value) for value in self.start))
        object.__setattr__(self, "goal", tuple(float(value) for value in self.goal))
        object.__setattr__(self, "obstacles", tuple(tuple(float(v) for v in centre) for centre in self.obstacles))
        if len(self.start) != 3:
            raise InvalidValueError("MapConfig.start", "three numbers (x, y, theta)", self.start)
        if len(self.goal) != 2 or any(len(centre) != 2 for centre in self.obstacles):
            raise InvalidValueError("MapConfig", "goal and obstacles as pairs (x, y)", (self.goal, self.obstacles))
        if len(self.obstacles) > MAX_OBSTACLES:
            raise InvalidValueError("MapConfig.obstacles", f"at most {MAX_OBSTACLES}", len(self.obstacles))
        numbers = (*self.start, *self.goal, *(value for centre in self.obstacles for value in centre))
        if not all(math.isfinite(number) for number in numbers) or not self.obstacle_size > 0:
            raise InvalidValueError("MapConfig", "finite positions and a positive obstacle size", self)

    def to_json(self) -> str:
        """The map as canonical JSON, the text that is attached to a recording."""
        return self._text(self.obstacles)

    @classmethod
    def from_json(cls, text: str | bytes) -> "MapConfig":
        """The inverse of `to_json`.

        Raises:
            InvalidValueError: the text is no map.
        """
        try:
            fields = json.loads(text)
            return cls(fields["start"], fields["goal"], fields["obstacles"], int(fields["obstacle_size"]))
        except (ValueError, KeyError, TypeError) as error:
            raise InvalidValueError("map", "JSON with start, goal, obstacles and obstacle_size", str(error)) from None

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits that are equal for equal maps, whatever the order of the obstacles."""
        return hashlib.sha256(self._text(sorted(self.obstacles)).encode()).hexdigest()[:8]

    def _text(self, obstacles: Sequence[tuple[float, float]]) -> str:
        return _CANONICAL.encode(
            {
                "start": self.start,
                "goal": self.goal,
                "obstacles": obstacles,
                "obstacle_size": self.obstacle_size,
                "window": WINDOW,
                "units": "px, rad; y down, theta counter-clockwise on screen",
            }
        )
