"""The table as a task: what it is in plain data, and where its parts are."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from copolicy.dataset.features import environment_state, map_of
from copolicy.dataset.task import PairTask, SimulatedPlayers, TaskSpec, Vector

from .map_config import MAX_OBSTACLES, WINDOW, MapConfig
from .maps import MAP_SETS, identify
from .physics import Physics
from .seats import TableSeats

if TYPE_CHECKING:
    from .world import TableWorld

_WIDTH, _HEIGHT = (float(side) for side in WINDOW)
_TURN = 2 * math.pi
_SPEED, _SPIN = 50.0, math.pi / 2  # px/s, the terminal speed of an axis under two full forces; rad/s

_VELOCITY = (("vx", "px/s", -_SPEED, _SPEED), ("vy", "px/s", -_SPEED, _SPEED), ("omega", "rad/s", -_SPIN, _SPIN))
_POSITION = (("x", "px", 0.0, _WIDTH), ("y", "px", 0.0, _HEIGHT))


def _vector(*entries: tuple[str, str, float, float]) -> Vector:
    return Vector(*zip(*entries, strict=True))


class TableTask(PairTask):
    """Two players carry a table past obstacles to a goal (Ng, Liu and Kennedy, RA-L 2023)."""

    spec: ClassVar[TaskSpec] = TaskSpec(
        name="table",
        sentence="Carry the table to the goal together.",
        state=_vector(*_POSITION, ("cos_theta", "1", -1.0, 1.0), ("sin_theta", "1", -1.0, 1.0), *_VELOCITY),
        recorded=_vector(*_POSITION, ("theta", "rad", 0.0, _TURN), *_VELOCITY),
        scenario=_vector(
            ("start_x", "px", 0.0, _WIDTH),
            ("start_y", "px", 0.0, _HEIGHT),
            ("start_theta", "rad", 0.0, _TURN),
            ("goal_x", "px", 0.0, _WIDTH),
            ("goal_y", "px", 0.0, _HEIGHT),
            *(
                (f"obstacle_{slot}_{axis}", "px", 0.0, side)
                for slot in range(MAX_OBSTACLES)
                for axis, side in (("x", _WIDTH), ("y", _HEIGHT))
            ),
        ),
        action=_vector(("fx", "a player's full force", -1.0, 1.0), ("fy", "a player's full force", -1.0, 1.0)),
        reasons=("goal", "collision_obstacle", "collision_wall", "timeout"),
    )
    scenario_type = MapConfig
    settings_type = Physics
    exchange = TableSeats()

    @property
    def agents(self) -> SimulatedPlayers:
        """Simulated pairs, partners and robots."""
        from .agents.players import PLAYERS

        return PLAYERS

    @property
    def scenario_sets(self) -> Mapping[str, Sequence[MapConfig]]:
        """The map sets."""
        return MAP_SETS

    def scenario_of_json(self, text: str | bytes) -> MapConfig:
        """See `MapConfig.from_json`."""
        return MapConfig.from_json(text)

    def scenario_vector(self, scenario: MapConfig) -> np.ndarray:
        """`(11,)` start pose, goal, and obstacles padded with zeros."""
        return environment_state(scenario)

    def scenario_of_vector(self, vector: np.ndarray, columns: Mapping[str, Any]) -> MapConfig:
        """The map of an `environment_state`; the size of its obstacles is the episode column `obstacle_size`."""
        return map_of(vector, columns["obstacle_size"])

    def make_world(self, scenario: MapConfig, settings: Physics | None = None) -> "TableWorld":
        """A table at rest at the start of a map."""
        from .world import TableWorld  # pymunk

        return TableWorld(scenario, settings)

    def states_of(self, recorded: np.ndarray) -> np.ndarray:
        """`(T, 6)` x, y, theta and velocity to `(T, 7)`, with the cosine that `TableWorld.observation` has."""
        thetas = recorded[:, 2].tolist()
        states = np.empty((len(recorded), 7))
        states[:, :2] = recorded[:, :2]
        states[:, 2] = [math.cos(theta) for theta in thetas]
        states[:, 3] = [math.sin(theta) for theta in thetas]
        states[:, 4:] = recorded[:, 3:]
        return states

    def identify(self, scenario: MapConfig) -> tuple[str, str]:
        """Name of a map and of its set, whatever the order of its obstacles; see `maps.identify`."""
        return identify(scenario)
