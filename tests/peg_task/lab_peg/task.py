"""Two players push a peg along a line to a mark."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from copolicy.dataset.exceptions import InvalidValueError, ShapeError
from copolicy.dataset.outline import Point, Shape, square
from copolicy.dataset.task import RUNNING, Outcome, PairTask, SimulatedPlayers
from copolicy.dataset.task_spec import TaskSpec, Vector

from .players import PLAYERS

LENGTH = 2.0  # m, the line from -LENGTH / 2 to LENGTH / 2
_CLOSE, _SLOW = 0.02, 0.05  # m, m/s: the peg is at the mark
_HZ = 20


@dataclass(frozen=True)
class Line:
    """Start of the peg and position of its mark, m."""

    start: float
    mark: float

    def __post_init__(self):
        if not all(abs(position) < LENGTH / 2 for position in (self.start, self.mark)):
            raise InvalidValueError("Line", f"positions within {LENGTH / 2} m", (self.start, self.mark))

    @property
    def digest(self) -> str:
        """Eight hexadecimal digits of the JSON's hash."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()[:8]

    def to_json(self) -> str:
        """Canonical JSON."""
        return json.dumps({"start": self.start, "mark": self.mark}, sort_keys=True)


@dataclass(frozen=True)
class Friction:
    """Settings of the peg's world."""

    step_limit: int = 200
    damping: float = 1.5  # 1/s
    push: float = 1.0  # m/s^2 of a player's full force


class PegWorld:
    """A peg on a line, moved by the sum of both forces against friction."""

    def __init__(self, line: Line, settings: Friction | None = None):
        self.line, self.settings = line, settings or Friction()
        self.restore((line.start, 0.0))

    @property
    def recorded(self) -> tuple[float, ...]:
        """Position and velocity (m, m/s)."""
        return self.position, self.velocity

    @property
    def observation(self) -> np.ndarray:
        """The same, `(2,)`."""
        return np.array(self.recorded)

    def restore(self, recorded: Sequence[float]) -> None:
        """Puts the peg into a state."""
        self.position, self.velocity = recorded
        self.step_count = 0

    def step(self, action: np.ndarray) -> Outcome:
        """Advances by 1/20 s."""
        action = np.asarray(action, float)
        if action.shape != (2,):
            raise ShapeError("action", (2,), action.shape)
        force = float(np.clip(action, -1.0, 1.0).sum())
        acceleration = self.settings.push * force - self.settings.damping * self.velocity
        self.velocity += acceleration / _HZ
        self.position += self.velocity / _HZ
        self.step_count += 1
        if abs(self.position - self.line.mark) < _CLOSE and abs(self.velocity) < _SLOW:
            return Outcome(True, True, "mark")
        if abs(self.position) >= LENGTH / 2:
            return Outcome(True, False, "off_the_line")
        return Outcome(True, False, "timeout") if self.step_count >= self.settings.step_limit else RUNNING

    def reward(self) -> float:
        """Minus the distance from the mark, m."""
        return -abs(self.position - self.line.mark)


class PegOutline:
    """A strip of floor with the peg on its line; see `Outline`."""

    size = (LENGTH, 0.4)
    unit = "m"
    arrow = 0.15
    body = (Shape("body", square((0.0, 0.0), 0.06)),)
    hands: tuple[Point, Point] = ((-0.03, 0.0), (0.03, 0.0))

    def fixed(self, scenario: Line) -> tuple[Shape, ...]:
        """The mark."""
        return (Shape("goal", square((scenario.mark + LENGTH / 2, 0.2), 2 * _CLOSE)),)

    def poses(self, states: np.ndarray) -> np.ndarray:
        """`(T, 3)` poses on the line with orientation 0."""
        poses = np.zeros((len(states), 3))
        poses[:, 0], poses[:, 1] = states[:, 0] + LENGTH / 2, self.size[1] / 2
        return poses

    def forces(self, actions: np.ndarray) -> np.ndarray:
        """`(T, 4)` forces along the line."""
        arrows = np.zeros((len(actions), 4))
        arrows[:, [0, 2]] = actions
        return arrows


class PegTask(PairTask):
    """A task with a spec, an outline and scripted players, without all other optional parts."""

    spec = TaskSpec(
        name="peg",
        title="pushing a peg",
        sentence="Push the peg to the mark together.",
        state=Vector(("position", "velocity"), ("m", "m/s"), (-LENGTH / 2, -1.5), (LENGTH / 2, 1.5)),
        recorded=Vector(("position", "velocity"), ("m", "m/s"), (-LENGTH / 2, -1.5), (LENGTH / 2, 1.5)),
        scenario=Vector(("start", "mark"), ("m", "m"), (-LENGTH / 2, -LENGTH / 2), (LENGTH / 2, LENGTH / 2)),
        action=Vector(("push",), ("a player's full force",), (-1.0,), (1.0,)),
        reasons=("mark", "off_the_line", "timeout"),
        successes=("mark",),
        record_hz=_HZ,
    )
    settings_type = Friction
    outline = PegOutline()

    @property
    def agents(self) -> SimulatedPlayers:
        """A pair, partners and a robot."""
        return PLAYERS

    @property
    def scenario_sets(self) -> Mapping[str, Sequence[Line]]:
        """Marks to the right, and marks to the left."""
        marks = (0.2, 0.4, 0.6)
        return {"right": tuple(Line(-0.5, mark) for mark in marks), "left": tuple(Line(0.5, -mark) for mark in marks)}

    def scenario_of_json(self, text: str | bytes) -> Line:
        """The inverse of `Line.to_json`."""
        try:
            return Line(**json.loads(text))
        except (TypeError, ValueError):
            raise InvalidValueError("scenario", "JSON of a line", text) from None

    def scenario_vector(self, scenario: Line) -> np.ndarray:
        """`(2,)` start and mark."""
        return np.array((scenario.start, scenario.mark))

    def scenario_of_vector(self, vector: np.ndarray, columns: Mapping[str, Any]) -> Line:
        """The inverse of `scenario_vector`, to single precision."""
        return Line(*(float(value) for value in vector))

    def make_world(self, scenario: Line, settings: Friction | None = None) -> PegWorld:
        """A peg at rest."""
        return PegWorld(scenario, settings)
