"""A map: start pose, goal and obstacles of an episode."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.scenarios import ScenarioName

WINDOW = (1200, 600)
"""Width and height of the world, px."""

MAX_OBSTACLES = 3
"""Slots for obstacles in an observation."""

_CANONICAL = json.JSONEncoder(sort_keys=True)


@dataclass(frozen=True)
class MapConfig:
    """Start pose, goal and obstacles of an episode.

    Attributes:
        start: pose of the table's centre at rest, (x, y, theta) in px and rad.
        goal: centre of the goal square, px.
        obstacles: centres of up to three solid squares, px, in the order of the observation.
        obstacle_size: side of the squares, px (50 in the training family, 45 in the paper's evaluation); of the largest
            where they differ.
        obstacle_sizes: side of each square, px, where they differ; empty where they are equal. `sizes` is always full.
        named: name and set of a map from a map file; not compared and not in the JSON.
    """

    start: tuple[float, float, float]
    goal: tuple[float, float]
    obstacles: tuple[tuple[float, float], ...] = ()
    obstacle_size: int = 50
    obstacle_sizes: tuple[int, ...] = ()
    named: ScenarioName | None = field(default=None, compare=False, repr=False)  # the field's name is in plan digests

    def __post_init__(self) -> None:
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
        if self.obstacle_sizes:
            sizes = tuple(int(size) for size in self.obstacle_sizes)
            if len(sizes) != len(self.obstacles) or min(sizes) <= 0:
                raise InvalidValueError("MapConfig.obstacle_sizes", "a positive size for each obstacle", sizes)
            object.__setattr__(self, "obstacle_size", max(sizes))
            object.__setattr__(self, "obstacle_sizes", sizes if len(set(sizes)) > 1 else ())

    @property
    def sizes(self) -> tuple[int, ...]:
        """Side of each obstacle, px."""
        return self.obstacle_sizes or (self.obstacle_size,) * len(self.obstacles)

    @property
    def squares(self) -> tuple[tuple[tuple[float, float], int], ...]:
        """Centre and side of each obstacle, px."""
        return tuple(zip(self.obstacles, self.sizes, strict=True))

    @property
    def layout(self) -> tuple[tuple[tuple[float, float], int], ...]:
        """The obstacles as in `squares`, sorted."""
        return tuple(sorted(self.squares))

    def to_json(self) -> str:
        """The map as canonical JSON, the attachment of a recording."""
        return self._text(self.squares)

    @classmethod
    def from_json(cls, text: str | bytes) -> "MapConfig":
        """The inverse of `to_json`.

        Raises:
            InvalidValueError: the text is not the JSON of a map.
        """
        try:
            fields = json.loads(text)
            sizes = tuple(fields.get("obstacle_sizes", ()))
            return cls(fields["start"], fields["goal"], fields["obstacles"], int(fields["obstacle_size"]), sizes)
        except (ValueError, KeyError, TypeError) as error:
            raise InvalidValueError("map", "JSON with start, goal, obstacles and obstacle_size", str(error)) from None

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits of the map's hash, which does not depend on the order of the obstacles."""
        return hashlib.sha256(self._text(self.layout).encode()).hexdigest()[:8]

    def _text(self, squares: Sequence[tuple[tuple[float, float], int]]) -> str:
        fields: dict[str, Any] = {
            "start": self.start,
            "goal": self.goal,
            "obstacles": [centre for centre, _ in squares],
            "obstacle_size": self.obstacle_size,
            "window": WINDOW,
            "units": "px, rad; y down, theta counter-clockwise on screen",
        }
        if self.obstacle_sizes:
            fields["obstacle_sizes"] = [size for _, size in squares]
        return _CANONICAL.encode(fields)
